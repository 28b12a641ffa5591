#include "client/cli/mission_file.h"

#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <system_error>

#include "absl/strings/str_format.h"
#include "client/cli/exit_code.h"

namespace fathom::client::cli {
namespace {

// $FATHOMD, else the one beside this program, else the one in PATH.
std::string FindFathomd() {
  if (const char* named = std::getenv("FATHOMD")) return named;
  std::error_code error;
  const auto self = std::filesystem::read_symlink("/proc/self/exe", error);
  const auto beside = self.parent_path() / "fathomd";
  if (!error && std::filesystem::exists(beside, error)) return beside;
  return "fathomd";
}

}  // namespace

absl::Status WorkOnMissionFile(const Session& session,
                               std::vector<std::string> arguments) {
  std::string program = FindFathomd();
  std::string room = "mission";
  std::string json = "--json";
  std::vector<char*> argv = {program.data(), room.data()};
  for (std::string& argument : arguments) argv.push_back(argument.data());
  if (session.json) argv.push_back(json.data());
  argv.push_back(nullptr);
  execvp(program.c_str(), argv.data());
  return FileError(absl::NotFoundError(absl::StrFormat(
      "%s cannot be started: %s; offline work on a mission file is the "
      "server's program's, name it with $FATHOMD",
      program, std::strerror(errno))));
}

}  // namespace fathom::client::cli
