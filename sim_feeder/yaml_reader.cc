#include "sim_feeder/yaml_reader.h"

#include <cmath>
#include <utility>

#include "absl/strings/str_format.h"

namespace fathom::feeder {

absl::StatusOr<YamlMap> YamlMap::Parse(const std::string& text,
                                       const std::string& name) {
  // yaml-cpp reports by exceptions; they end here.
  YAML::Node node;
  try {
    node = YAML::Load(text);
  } catch (const YAML::Exception& error) {
    return absl::InvalidArgumentError(
        absl::StrFormat("%s:%d: %s", name, error.mark.line + 1, error.msg));
  }
  if (!node.IsMap()) {
    return absl::InvalidArgumentError(
        absl::StrFormat("%s:1: is no map of keys and values", name));
  }
  auto file = std::make_shared<File>();
  file->name = name;
  return YamlMap(std::move(file), std::move(node), "");
}

YamlMap::YamlMap(std::shared_ptr<File> file, YAML::Node node, std::string path)
    : file_(std::move(file)), asked_(std::make_shared<Asked>()) {
  asked_->node = std::move(node);
  asked_->path = std::move(path);
  file_->maps.push_back(asked_);
}

std::string YamlMap::PathOf(const Asked& map, const std::string& key) {
  return map.path.empty() ? key : map.path + "." + key;
}

bool YamlMap::Has(const std::string& key) const {
  return node().IsMap() && static_cast<bool>(node()[key]);
}

YAML::Node YamlMap::Take(const std::string& key) {
  asked_->keys.insert(key);
  return Has(key) ? node()[key] : YAML::Node(YAML::NodeType::Undefined);
}

void YamlMap::Fail(int line, const std::string& what) {
  if (!file_->status.ok()) return;
  file_->status = absl::InvalidArgumentError(
      absl::StrFormat("%s:%d: %s", file_->name, line, what));
}

void YamlMap::Refuse(const std::string& key, const std::string& what) {
  Fail(Has(key) ? node()[key].Mark().line + 1 : line(),
       absl::StrFormat("%s %s", PathOf(key), what));
}

// False: absent, or an error was noted.
template <typename Value>
bool YamlMap::Scalar(const std::string& key, const char* kind, Value& value) {
  const YAML::Node node = Take(key);
  if (!node.IsDefined()) return false;
  if (node.IsScalar() && YAML::convert<Value>::decode(node, value)) {
    return true;
  }
  Refuse(key, absl::StrFormat("must be %s", kind));
  return false;
}

void YamlMap::Read(const std::string& key, double& value, double least,
                   double most) {
  double read = 0;
  if (!Scalar(key, "a number", read)) return;
  if (!(read >= least && read <= most)) {
    Fail(node()[key].Mark().line + 1,
         absl::StrFormat("%s=%g must be in [%g, %g]", PathOf(key), read, least,
                         most));
    return;
  }
  value = read;
}

void YamlMap::Read(const std::string& key, std::optional<double>& value,
                   double least, double most) {
  if (!Has(key)) {
    asked_->keys.insert(key);
    return;
  }
  double read = 0;
  Read(key, read, least, most);
  value = read;
}

void YamlMap::Read(const std::string& key, int& value, int least, int most) {
  double read = value;
  Read(key, read, least, most);
  if (read != std::floor(read)) Refuse(key, "must be a whole number");
  value = static_cast<int>(read);
}

void YamlMap::Read(const std::string& key, std::uint64_t& value) {
  std::uint64_t read = 0;
  if (Scalar(key, "a whole number of 0 or more", read)) value = read;
}

void YamlMap::Read(const std::string& key, std::string& value) {
  std::string read;
  if (Scalar(key, "a text", read)) value = read;
}

void YamlMap::Read(const std::string& key, bool& value) {
  bool read = false;
  if (Scalar(key, "true or false", read)) value = read;
}

void YamlMap::Read(const std::string& key, std::optional<Time>& value) {
  std::string text;
  if (!Scalar(key, "a time, RFC 3339", text)) return;
  const absl::StatusOr<Time> time = ParseTime(text);
  if (!time.ok()) {
    Refuse(key, std::string(time.status().message()));
    return;
  }
  value = *time;
}

void YamlMap::ReadName(const std::string& key, std::size_t& value,
                       const std::vector<std::string>& names) {
  std::string read;
  if (!Scalar(key, "a name", read)) return;
  std::string all;
  for (std::size_t n = 0; n < names.size(); ++n) {
    if (names[n] == read) {
      value = n;
      return;
    }
    all += (n == 0 ? "" : ", ") + names[n];
  }
  Refuse(key, absl::StrFormat("is '%s', not one of: %s", read, all));
}

YamlMap YamlMap::Child(const std::string& key) {
  YAML::Node node = Take(key);
  if (!node.IsDefined() || node.IsNull()) {
    return YamlMap(file_, YAML::Node(YAML::NodeType::Map), PathOf(key));
  }
  if (!node.IsMap()) {
    Refuse(key, "must be a map of keys and values");
    node = YAML::Node(YAML::NodeType::Map);
  }
  return YamlMap(file_, std::move(node), PathOf(key));
}

std::vector<YamlMap> YamlMap::Children(const std::string& key) {
  const YAML::Node list = Take(key);
  std::vector<YamlMap> maps;
  if (!list.IsDefined()) return maps;
  if (!list.IsSequence()) {
    Refuse(key, "must be a list");
    return maps;
  }
  for (std::size_t n = 0; n < list.size(); ++n) {
    const std::string path = absl::StrFormat("%s[%d]", PathOf(key), n);
    if (!list[n].IsMap()) {
      Fail(list[n].Mark().line + 1, path + " must be a map of keys and values");
      return maps;
    }
    maps.push_back(YamlMap(file_, list[n], path));
  }
  return maps;
}

absl::Status YamlMap::Finish() {
  if (!file_->status.ok()) return file_->status;
  for (const std::shared_ptr<Asked>& map : file_->maps) {
    for (const auto& entry : map->node) {
      const auto key = entry.first.as<std::string>("");
      if (map->keys.contains(key)) continue;
      std::string known;
      for (const std::string& name : map->keys) {
        known += (known.empty() ? "" : ", ") + name;
      }
      Fail(entry.first.Mark().line + 1,
           absl::StrFormat("unknown key %s; known here: %s", PathOf(*map, key),
                           known));
      return file_->status;
    }
  }
  return absl::OkStatus();
}

}  // namespace fathom::feeder
