// What every verb is given: the flags before the verb, a way to the server,
// and a way to print.
//
// A verb registers itself on the CLI11 app and stores what it would do in
// `run`; main() runs it after the whole command line was understood.

#ifndef FATHOM_CLIENT_CLI_SESSION_H_
#define FATHOM_CLIENT_CLI_SESSION_H_

#include <google/protobuf/message.h>

#include <CLI/CLI.hpp>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "base/time.h"
#include "client/cli/exit_code.h"
#include "client/client.h"
#include "client/tls.h"

namespace fathom::client::cli {

struct Session {
  std::string server = "127.0.0.1:7430";
  // Bounds each call; 0: the library's defaults.
  double timeout_s = 0;
  bool json = false;
  TlsFiles tls = {};
  // Set by the verb that the command line names.
  std::function<absl::Status()> run = nullptr;
  // How the command ends if that went well.
  ExitCode exit_code = ExitCode::kOk;

  // Errors: as Client::Connect; INVALID_ARGUMENT marked as the user's (a
  // certificate without its key) or NOT_FOUND as the file's.
  absl::StatusOr<std::unique_ptr<Client>> Connect() const;
  Time Now() const;
};

// A message as JSON with the contract's field names; numbers that are zero
// are there too, so that a script need not guess.
nlohmann::ordered_json ToJson(const google::protobuf::Message& message);

// One document on standard output, indented.
void PrintJson(const nlohmann::ordered_json& document);
// One document on one line, at once: for those that come one after the other.
void PrintJsonLine(const nlohmann::ordered_json& document);
// printf to standard output.
void Print(const std::string& text);
// A line to standard error: progress and decisions, never results.
void Note(const std::string& text);

// The verbs; each has its own file.
void AddStatus(CLI::App& app, Session& session);
void AddMission(CLI::App& app, Session& session);
void AddActivity(CLI::App& app, Session& session);
void AddQuery(CLI::App& app, Session& session);
void AddCheck(CLI::App& app, Session& session);
void AddNearest(CLI::App& app, Session& session);
void AddContacts(CLI::App& app, Session& session);
void AddWatch(CLI::App& app, Session& session);
void AddPrior(CLI::App& app, Session& session);
void AddExport(CLI::App& app, Session& session);
void AddRender(CLI::App& app, Session& session);

}  // namespace fathom::client::cli

#endif  // FATHOM_CLIENT_CLI_SESSION_H_
