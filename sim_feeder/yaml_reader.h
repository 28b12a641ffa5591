// A map of a YAML file, read strictly: each key is asked for by name, with its
// range; what nobody asked for is an error. Messages name file, line, key and
// range: "bad_day.yaml:12: sonar.beam_std_m=-1 must be in [0, 100]".
//
//   YamlMap sonar = file.Child("sonar");
//   sonar.Read("beam_std_m", options.beam_std_m, 0, 100);
//   FATHOM_RETURN_IF_ERROR(file.Finish());   // also of all children
//
// The first error stays; what is read after it changes nothing. Not
// thread-safe.

#ifndef FATHOM_SIM_FEEDER_YAML_READER_H_
#define FATHOM_SIM_FEEDER_YAML_READER_H_

#include <yaml-cpp/yaml.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "base/time.h"

namespace fathom::feeder {

class YamlMap {
 public:
  // The map that `text` is; `name` is the file's, for messages. Errors:
  // INVALID_ARGUMENT with the line where it is no YAML or no map.
  static absl::StatusOr<YamlMap> Parse(const std::string& text,
                                       const std::string& name);

  bool Has(const std::string& key) const;

  // Each leaves `value` where the key is absent.
  void Read(const std::string& key, double& value, double least, double most);
  void Read(const std::string& key, std::optional<double>& value, double least,
            double most);
  void Read(const std::string& key, int& value, int least, int most);
  void Read(const std::string& key, std::uint64_t& value);
  void Read(const std::string& key, std::string& value);
  void Read(const std::string& key, bool& value);
  void Read(const std::string& key, std::optional<Time>& value);
  // One of `names`; the number of it.
  void ReadName(const std::string& key, std::size_t& value,
                const std::vector<std::string>& names);

  // The map below the key; an empty one where it is absent.
  YamlMap Child(const std::string& key);
  // The maps of a list below the key; none where it is absent.
  std::vector<YamlMap> Children(const std::string& key);

  // An error of the caller's about a key, with its place; absent keys have
  // that of the map.
  void Refuse(const std::string& key, const std::string& what);

  int line() const { return node().Mark().line + 1; }

  // The first error, or that of a key that nobody asked for, in this map or a
  // child of it.
  absl::Status Finish();

 private:
  // A map of the file and the keys that were asked for.
  struct Asked {
    YAML::Node node;
    std::string path;
    std::set<std::string> keys;
  };
  struct File {
    std::string name;
    absl::Status status;
    // Finish of any map of the file looks at all of them.
    std::vector<std::shared_ptr<Asked>> maps;
  };

  YamlMap(std::shared_ptr<File> file, YAML::Node node, std::string path);

  YAML::Node Take(const std::string& key);
  template <typename Value>
  bool Scalar(const std::string& key, const char* kind, Value& value);
  void Fail(int line, const std::string& what);
  static std::string PathOf(const Asked& map, const std::string& key);
  std::string PathOf(const std::string& key) const {
    return PathOf(*asked_, key);
  }
  const YAML::Node& node() const { return asked_->node; }

  std::shared_ptr<File> file_;
  std::shared_ptr<Asked> asked_;
};

}  // namespace fathom::feeder

#endif  // FATHOM_SIM_FEEDER_YAML_READER_H_
