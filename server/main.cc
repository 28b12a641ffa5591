// fathomd: the obstacle-map server. Opens (or makes) a mission file, serves it
// until SIGTERM or SIGINT, and leaves it closed cleanly.
//
// Exit codes (the reason is the last line on standard error):
//   0  stopped as asked
//   1  could not start; nothing was changed
//   2  flags that make no sense
//   3  the mission file could not be written while serving (an I/O error, or
//      the disk was still full at the end, or a damaged page in the way): what
//      was acknowledged is in it, what was not must be sent again. A supervisor
//      should start it again (with a damaged page: once it is repaired).

#include <pthread.h>
#include <signal.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_format.h"
#include "base/clock.h"
#include "base/log.h"
#include "base/status_macros.h"
#include "server/map_keeper.h"
#include "server/mission.h"
#include "server/mission_store.h"
#include "server/mission_tool.h"
#include "server/server.h"
#include "server/server_context.h"
#include "storage/mission_file.h"

namespace fathom::server {
namespace {

constexpr int kExitCannotStart = 1;
constexpr int kExitMisuse = 2;
constexpr int kExitFileFailed = 3;

// More is no limit: a century, an exabyte.
constexpr double kMaxHistoryAgeDays = 36'525;
constexpr std::uint64_t kMaxHistoryMb = 1'000'000'000'000;

// A tebibyte: a hundred times what a map of the most cells (10^9) takes.
constexpr std::uint64_t kMaxGlobalMemoryMib = std::uint64_t{1} << 20;

constexpr double kMetresPerNmi = 1852;  // Exact, by definition.

constexpr char kAbout[] =
    R"(fathomd serves one mission's obstacle map over gRPC (package fathom.v1).

It fuses sonar pings and contact reports, keeps the map in one mission file
and answers "is there an obstacle at this place, time and confidence?".

  Make a mission of 20 x 20 nautical miles and serve it on a free port:
    fathomd --mission bay.fathom --create --center 41.5,-71.4 --side-nmi 20 \
            --listen 127.0.0.1:0

  Serve it again later:
    fathomd --mission bay.fathom

  Work on a mission file that no server holds (info, verify, digest, repair,
  compact, export, import):
    fathomd mission verify bay.fathom

When it serves, it prints one line on standard output:
  fathomd: ready on ADDR mission FILE revision N
SIGTERM drains it: streams end when what they sent is on the disk.

Exit codes: 0 stopped as asked, 1 could not start, 2 wrong flags, 3 the mission
file could not be written while serving (nothing acknowledged is lost).)";

struct Flags {
  std::string mission_path;
  bool create = false;
  std::string south_west;
  std::string north_west;
  std::string center;
  double side_nmi = 0;
  double ageing_m2_per_day = 0;
  std::optional<double> history_max_age_days;
  std::optional<std::uint64_t> history_max_mb;
  // 64 MiB: some 7 million leaves are all at hand.
  std::uint64_t global_memory_mib = 64;
  NewMission mission;
  ListenOptions listen;
  std::string log_level = "info";
  std::string port_file;
};

void AddFlags(CLI::App& app, Flags& flags) {
  app.add_option("--mission", flags.mission_path,
                 "The mission file. One server at a time may hold it")
      ->required()
      ->type_name("FILE");
  app.add_option("--listen", flags.listen.address,
                 "HOST:PORT (port 0: any free one) or unix:PATH. Addresses "
                 "that other machines can reach need mutual TLS")
      ->capture_default_str()
      ->type_name("ADDR");
  app.add_option("--port-file", flags.port_file,
                 "Write the port to this file once serving (for scripts)")
      ->type_name("FILE");
  app.add_option("--log-level", flags.log_level,
                 "debug, info, warning or error; the log goes to standard "
                 "error")
      ->capture_default_str();

  app.add_option("--global-memory-mib", flags.global_memory_mib,
                 "Memory for the parts of the global map that are ready to be "
                 "read, MiB (about 9 bytes a cell). What was not read for "
                 "longest is kept beside it packed, in 3 bytes a cell, and "
                 "takes 0.1 ms to unpack when it is asked for; nothing is read "
                 "from the disk")
      ->check(CLI::Range(std::uint64_t{1}, kMaxGlobalMemoryMib))
      ->capture_default_str()
      ->type_name("MIB");

  const char* const kHistory = "The contact history (all is kept by default)";
  app.add_option("--history-max-age-days", flags.history_max_age_days,
                 "Estimates older than this beside the newest estimate are "
                 "forgotten, a block at a time, with each checkpoint")
      ->check(CLI::Range(1e-3, kMaxHistoryAgeDays))
      ->group(kHistory)
      ->type_name("DAYS");
  app.add_option(
         "--history-max-mb", flags.history_max_mb,
         "Most megabytes of it, what GDAL shows of it included (1 MB: about "
         "8000 estimates); the oldest go first")
      ->check(CLI::Range(std::uint64_t{1}, kMaxHistoryMb))
      ->group(kHistory)
      ->type_name("MB");

  const char* const kNew = "A new mission";
  CLI::Option* const create =
      app.add_flag("--create", flags.create,
                   "Make the mission file; it must not exist yet")
          ->group(kNew);
  const auto add = [&](const char* name, auto& value, const char* help) {
    return app.add_option(name, value, help)->needs(create)->group(kNew);
  };
  add("--center", flags.center,
      "Middle of the mission's square, degrees; with --side-nmi")
      ->type_name("LAT,LON");
  add("--side-nmi", flags.side_nmi,
      "Side of the square, nautical miles (1852 m)");
  add("--south-west", flags.south_west,
      "Or: the square's south-west corner, degrees")
      ->type_name("LAT,LON");
  add("--north-west", flags.north_west,
      "and its north-west corner; the square lies east of the line")
      ->type_name("LAT,LON");
  add("--min-cell-m", flags.mission.min_cell_m,
      "Finest cell of the global map, metres")
      ->capture_default_str();
  add("--tolerance-m", flags.mission.tolerance_m,
      "Neighbouring cells whose depths agree within this become one, metres")
      ->capture_default_str();
  add("--max-cells", flags.mission.max_cells,
      "Most cells of the global map (about 12 bytes each; 3 beyond "
      "--global-memory-mib)")
      ->capture_default_str();
  add("--max-contacts", flags.mission.max_contacts,
      "Most moving obstacles tracked at once")
      ->capture_default_str();
  add("--ageing-m2-per-day", flags.ageing_m2_per_day,
      "Variance that static evidence gains per day of age, m^2; 0: it never "
      "ages")
      ->capture_default_str();
  add("--name", flags.mission.name, "The mission's name, for people");
  add("--datum", flags.mission.vertical_datum,
      "What all depths are measured from, e.g. MLLW, MSL")
      ->capture_default_str();

  const char* const kTls = "Mutual TLS (PEM files, all three or none)";
  app.add_option("--tls-cert", flags.listen.tls_cert,
                 "The server's certificate chain")
      ->group(kTls)
      ->type_name("FILE");
  app.add_option("--tls-key", flags.listen.tls_key, "Its private key")
      ->group(kTls)
      ->type_name("FILE");
  app.add_option("--tls-client-ca", flags.listen.tls_client_ca,
                 "Authority whose clients are let in")
      ->group(kTls)
      ->type_name("FILE");
}

absl::Status ReadPoint(const char* flag, const std::string& text,
                       std::optional<map::GeodeticPoint>& point) {
  if (text.empty()) return absl::OkStatus();
  auto parsed = ParsePoint(text);
  if (!parsed.ok()) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "%s: %s", flag, std::string(parsed.status().message())));
  }
  point = *parsed;
  return absl::OkStatus();
}

absl::StatusOr<std::unique_ptr<storage::MissionFile>> OpenFile(
    Flags& flags, const Clock& clock) {
  if (!flags.create) {
    return storage::MissionFile::Open(flags.mission_path,
                                      {.tell = [](const std::string& line) {
                                        Log(LogLevel::kInfo, "%s", line);
                                      }});
  }
  NewMission& mission = flags.mission;
  FATHOM_RETURN_IF_ERROR(ReadPoint("--center", flags.center, mission.center));
  FATHOM_RETURN_IF_ERROR(
      ReadPoint("--south-west", flags.south_west, mission.south_west));
  FATHOM_RETURN_IF_ERROR(
      ReadPoint("--north-west", flags.north_west, mission.north_west));
  mission.side_m = flags.side_nmi * kMetresPerNmi;
  mission.ageing_rate_m2_s = flags.ageing_m2_per_day / 86'400;
  return CreateMission(flags.mission_path, mission, clock.Now());
}

storage::HistoryLimits HistoryLimitsOf(const Flags& flags) {
  storage::HistoryLimits limits;
  if (flags.history_max_age_days.has_value()) {
    constexpr double kMicrosPerDay = 86'400e6;
    limits.max_age = Duration(
        static_cast<std::int64_t>(*flags.history_max_age_days * kMicrosPerDay));
  }
  if (flags.history_max_mb.has_value()) {
    limits.max_bytes = *flags.history_max_mb * 1'000'000;
  }
  return limits;
}

// Written beside and renamed, so that a reader never sees half a number.
absl::Status WritePortFile(const std::string& path, const Server& server) {
  const std::string part = path + ".part";
  std::FILE* const file = std::fopen(part.c_str(), "w");
  if (file == nullptr) {
    return absl::InvalidArgumentError(
        absl::StrFormat("--port-file=%s cannot be written", path));
  }
  std::fprintf(file, "%d\n", server.port());
  if (std::fclose(file) != 0 || std::rename(part.c_str(), path.c_str()) != 0) {
    return absl::InternalError(
        absl::StrFormat("--port-file=%s cannot be written", path));
  }
  return absl::OkStatus();
}

// Blocks the signals that end the program, for this thread and those that it
// starts: only Serve waits for them.
sigset_t BlockEndSignals() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGINT);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  return signals;
}

// Removes the mission file that this program has just made unless Keep is
// called: a start that fails leaves nothing behind and can be repeated.
class NewFileGuard {
 public:
  explicit NewFileGuard(const std::string& path) : path_(path) {}
  ~NewFileGuard() {
    if (!path_.empty()) std::remove(path_.c_str());
  }
  NewFileGuard(const NewFileGuard&) = delete;
  NewFileGuard& operator=(const NewFileGuard&) = delete;
  void Keep() { path_.clear(); }

 private:
  std::string path_;
};

// Sets `file_failed` if the mission file stood in the way of what was taken in.
absl::Status Serve(Flags& flags, bool& file_failed) {
  FATHOM_RETURN_IF_ERROR(CheckListenOptions(flags.listen));
  const sigset_t signals = BlockEndSignals();
  // A client that goes away is an error of its call, not of the program.
  signal(SIGPIPE, SIG_IGN);

  // The reason is told once, by us; gRPC's own lines are for its developers.
  setenv("GRPC_VERBOSITY", "NONE", /*overwrite=*/0);

  const SystemClock clock;
  FATHOM_ASSIGN_OR_RETURN(const auto file, OpenFile(flags, clock));
  file->LimitHistory(HistoryLimitsOf(flags));
  NewFileGuard guard(flags.create ? flags.mission_path : "");
  FATHOM_ASSIGN_OR_RETURN(MapKeeper::Restored restored,
                          RestoreMission(*file, flags.global_memory_mib << 20));
  Log(LogLevel::kInfo, "mission opened path=%s revision=%d replayed=%d",
      flags.mission_path, restored.map->revision(), restored.journal_records);
  for (const std::string& damage : restored.damage) {
    Log(LogLevel::kError, "left out, its place is unknown: %s", damage);
  }
  const std::vector<std::string> damage = restored.damage;

  std::atomic<bool> failed{false};
  KeeperOptions options;
  options.on_fatal = [&failed](const absl::Status& status) {
    Log(LogLevel::kError, "the mission file failed: %s", status.ToString());
    failed = true;
    // Wakes sigwait; the server then stops like on any other SIGTERM.
    kill(getpid(), SIGTERM);
  };
  MissionFileStore store(*file);
  MapKeeper keeper(std::move(restored), store, std::move(options));
  ServerContext context{
      .keeper = keeper, .file = *file, .clock = clock, .damage = damage};
  FATHOM_ASSIGN_OR_RETURN(const auto server,
                          Server::Start(flags.listen, context));
  if (!flags.port_file.empty()) {
    FATHOM_RETURN_IF_ERROR(WritePortFile(flags.port_file, *server));
  }
  absl::PrintF("fathomd: ready on %s mission %s revision %d\n",
               server->address(), flags.mission_path,
               keeper.View()->revision());
  std::fflush(stdout);
  guard.Keep();

  int signal_number = 0;
  sigwait(&signals, &signal_number);
  Log(LogLevel::kInfo, "stopping signal=%d", signal_number);
  server->Drain();
  const absl::Status stopped = keeper.Stop();
  const absl::Status closed = file->Close();
  if (failed || !stopped.ok()) {
    file_failed = true;
    return absl::Status(
        stopped.code(),
        absl::StrFormat("not everything could be written (%s): %s",
                        absl::IsDataLoss(stopped)
                            ? "the file is damaged, what it holds is untouched"
                            : "nothing acknowledged is lost",
                        std::string(stopped.message())));
  }
  FATHOM_RETURN_IF_ERROR(closed);
  Log(LogLevel::kInfo, "stopped path=%s revision=%d", flags.mission_path,
      keeper.View()->revision());
  return absl::OkStatus();
}

int Main(int argc, char** argv) {
  CLI::App app(kAbout, "fathomd");
  app.set_version_flag("--version", "fathomd " FATHOM_VERSION);
  Flags flags;
  AddFlags(app, flags);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : kExitMisuse;
  }
  const auto level = ParseLogLevel(flags.log_level);
  if (!level.ok()) {
    absl::FPrintF(stderr, "fathomd: --log-level: %s\n",
                  std::string(level.status().message()));
    return kExitMisuse;
  }
  InitLog("fathomd", *level);
  bool file_failed = false;
  const absl::Status status = Serve(flags, file_failed);
  if (status.ok()) return 0;
  absl::FPrintF(stderr, "fathomd: %s\n", std::string(status.message()));
  if (file_failed) return kExitFileFailed;
  return absl::IsInvalidArgument(status) ? kExitMisuse : kExitCannotStart;
}

}  // namespace
}  // namespace fathom::server

int main(int argc, char** argv) {
  if (argc > 1 && std::string_view(argv[1]) == "mission") {
    return fathom::server::MissionToolMain(argc - 1, argv + 1);
  }
  return fathom::server::Main(argc, argv);
}
