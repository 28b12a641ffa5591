// fathom: the command line of a Fathom server.
//
// Reads the command line, runs one verb (each in its own file) and turns its
// status into a message and an exit code.

#include <cstdio>
#include <exception>

#include "client/cli/completion.h"
#include "client/cli/exit_code.h"
#include "client/cli/session.h"
#include "client/errors.h"

namespace fathom::client::cli {
namespace {

constexpr char kDescription[] =
    R"(Ask a Fathom obstacle-map server, and bring it charts.)";

constexpr char kFooter[] = R"(
Examples:
  fathom status
  fathom prior import etopo5.cdf --positive up --std-m 10
  fathom query --at 41.6,-71.4 --depth-m 20 --confidence 0.95
  fathom check plan.csv --radius-m 5 --clearance-m 3
  fathom nearest --at 41.6,-71.4 --depth-m 20
  fathom activity start bay --center 41.6,-71.4 --size-m 1000 --cell-m 10
  fathom contacts list --time +10min
  fathom watch contacts
  fathom export --activity bay --out bay.tif
  fathom render --out map.png
  fathom VERB --help            every verb explains itself

With --json a verb prints one JSON document on standard output (watch: one a
line); progress and remarks go to standard error.

Exit codes:
  0  done
  1  the command line is wrong (nothing was sent)
  2  the server said no (the reason is printed)
  3  no server answered (is fathomd running? --server, $FATHOM_SERVER; behind
     TLS: --tls-ca, --tls-cert, --tls-key)
  4  a file given is missing, damaged or not usable
  5  check: the trajectory meets an obstacle, or what counts as one
  6  check: it meets none, but is not certain enough to be FREE)";

int Report(const Session& session, const absl::Status& status) {
  const ExitCode code = ExitCodeOf(status);
  if (code == ExitCode::kOk) return static_cast<int>(session.exit_code);
  const std::string name = absl::StatusCodeToString(status.code());
  if (session.json) {
    nlohmann::ordered_json error;
    error["code"] = name;
    error["message"] = std::string(status.message());
    error["fields"] = nlohmann::ordered_json::array();
    for (const FieldError& field : FieldErrors(status)) {
      error["fields"].push_back(
          {{"field", field.field}, {"description", field.description}});
    }
    PrintJson({{"error", error}});
  }
  std::fprintf(stderr, "fathom: %s (%s)\n",
               std::string(status.message()).c_str(), name.c_str());
  return static_cast<int>(code);
}

int Main(int argc, char** argv) {
  Session session;
  CLI::App app(kDescription, "fathom");
  app.footer(kFooter);
  app.require_subcommand(1);
  app.fallthrough();
  app.get_formatter()->column_width(32);
  app.add_option("--server", session.server,
                 "HOST:PORT or unix:/PATH of the server")
      ->envname("FATHOM_SERVER")
      ->capture_default_str();
  app.add_option("--timeout-s", session.timeout_s,
                 "Give up a call after this many seconds (default: 10, and "
                 "600 for imports, transfers and areas)")
      ->check(CLI::PositiveNumber);
  app.add_option("--tls-ca", session.tls.ca,
                 "PEM file of the authority that signed the server's "
                 "certificate; speaks TLS instead of plain text")
      ->envname("FATHOM_TLS_CA")
      ->type_name("FILE");
  app.add_option("--tls-cert", session.tls.cert,
                 "PEM file of our certificate, for servers that ask for one; "
                 "with --tls-key")
      ->envname("FATHOM_TLS_CERT")
      ->type_name("FILE");
  app.add_option("--tls-key", session.tls.key, "PEM file of its private key")
      ->envname("FATHOM_TLS_KEY")
      ->type_name("FILE");
  app.add_flag("--json", session.json, "Print one JSON document");
  app.set_version_flag("--version", std::string(FATHOM_VERSION));
  AddStatus(app, session);
  AddMission(app, session);
  AddActivity(app, session);
  AddQuery(app, session);
  AddCheck(app, session);
  AddNearest(app, session);
  AddContacts(app, session);
  AddWatch(app, session);
  AddPrior(app, session);
  AddExport(app, session);
  AddRender(app, session);
  app.add_subcommand("completion",
                     "Print the completion script for bash: source <(fathom "
                     "completion)")
      ->callback([&session, &app]() {
        session.run = [&app]() {
          Print(BashCompletion(app));
          return absl::OkStatus();
        };
      });
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    const int code = app.exit(error);
    return code == 0 ? 0 : static_cast<int>(ExitCode::kUsage);
  }
  if (!session.run) return static_cast<int>(ExitCode::kUsage);
  return Report(session, session.run());
}

}  // namespace
}  // namespace fathom::client::cli

int main(int argc, char** argv) {
  try {
    return fathom::client::cli::Main(argc, argv);
  } catch (const std::exception& error) {
    // Only memory and standard output can fail like this.
    std::fprintf(stderr, "fathom: %s\n", error.what());
    return static_cast<int>(fathom::client::cli::ExitCode::kRefused);
  }
}
