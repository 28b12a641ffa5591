// A real fathomd process on a free loopback port, for the integration tests in
// C++. FATHOM_FATHOMD is the program (tests/integration/CMakeLists.txt).

#ifndef FATHOM_TESTS_INTEGRATION_LIVE_SERVER_H_
#define FATHOM_TESTS_INTEGRATION_LIVE_SERVER_H_

#include <gtest/gtest.h>
#include <signal.h>
#include <stdlib.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"

namespace fathom::client {

inline constexpr auto kDeadline = std::chrono::seconds(60);

// A fathomd process, killed with this object.
class LiveServer {
 public:
  // On the mission file in `folder`; port 0: a free one; `flags`: fathomd's
  // further ones. port() is 0 if it did not come up.
  LiveServer(std::filesystem::path folder, bool create, int port = 0,
             const std::vector<std::string>& flags = {})
      : folder_(std::move(folder)) {
    const auto port_file = folder_ / "port";
    std::filesystem::remove(port_file);
    std::vector<std::string> arguments = {FATHOM_FATHOMD,
                                          "--mission",
                                          folder_ / "m.fathom",
                                          "--listen",
                                          absl::StrCat("127.0.0.1:", port),
                                          "--port-file",
                                          port_file,
                                          "--log-level",
                                          "error"};
    if (create) {
      for (const char* argument : {"--create", "--center", "41.5,-71.4",
                                   "--side-nmi", "20", "--datum", "MLLW"}) {
        arguments.emplace_back(argument);
      }
    }
    arguments.insert(arguments.end(), flags.begin(), flags.end());
    std::vector<char*> argv;
    for (std::string& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    pid_ = fork();
    if (pid_ == 0) {
      execv(argv[0], argv.data());
      _exit(127);
    }
    const auto deadline = std::chrono::steady_clock::now() + kDeadline;
    while (port_ == 0 && std::chrono::steady_clock::now() < deadline) {
      std::ifstream(port_file) >> port_;
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
  }

  ~LiveServer() { Kill(); }
  LiveServer(const LiveServer&) = delete;
  LiveServer& operator=(const LiveServer&) = delete;

  void Kill() { End(SIGKILL); }

  // The exit code.
  int Terminate() { return End(SIGTERM); }

  int port() const { return port_; }
  std::string address() const { return absl::StrCat("127.0.0.1:", port_); }

 private:
  int End(int signal_number) {
    if (pid_ <= 0) return -1;
    kill(pid_, signal_number);
    int state = 0;
    waitpid(pid_, &state, 0);
    pid_ = -1;
    return WIFEXITED(state) ? WEXITSTATUS(state) : -1;
  }

  const std::filesystem::path folder_;
  pid_t pid_ = -1;
  int port_ = 0;
};

// A test with a folder of its own, removed afterwards.
class ClientLive : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string name =
        (std::filesystem::temp_directory_path() / "fathom-live-XXXXXX")
            .string();
    ASSERT_NE(mkdtemp(name.data()), nullptr);
    folder_ = name;
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::filesystem::path folder_;
};

}  // namespace fathom::client

#endif  // FATHOM_TESTS_INTEGRATION_LIVE_SERVER_H_
