// The path of a field in a request, as errors name it:
// "reports[3].fix.position.latitude_deg".
//
// A path is a list of nodes on the stack, from the leaf to the root; it costs
// nothing until an error writes it out, so the query path validates without
// allocating. A node points at its parent: pass paths down, never keep them.

#ifndef FATHOM_SERVER_FIELD_PATH_H_
#define FATHOM_SERVER_FIELD_PATH_H_

#include <cstddef>
#include <string>

namespace fathom::server {

// One step of a path. Not thread-safe, not to outlive its parent.
class FieldPath {
 public:
  // The request itself: "".
  FieldPath() = default;
  // `name` must outlive the path (a literal).
  FieldPath(const FieldPath& parent, const char* name)
      : parent_(&parent), name_(name) {}
  // Element `index` of the repeated field `name`.
  FieldPath(const FieldPath& parent, const char* name, size_t index)
      : parent_(&parent), name_(name), index_(index) {}

  std::string ToString() const {
    std::string text;
    AppendTo(text);
    return text;
  }

 private:
  static constexpr size_t kNoIndex = static_cast<size_t>(-1);

  void AppendTo(std::string& text) const {
    if (parent_ == nullptr) return;
    parent_->AppendTo(text);
    if (!text.empty()) text += '.';
    text += name_;
    if (index_ != kNoIndex) text += '[' + std::to_string(index_) + ']';
  }

  const FieldPath* parent_ = nullptr;
  const char* name_ = "";
  size_t index_ = kNoIndex;
};

}  // namespace fathom::server

#endif  // FATHOM_SERVER_FIELD_PATH_H_
