// Crash points: a power cut after every operation that the mission file asks
// of the disk, in several ways each (crash_image.h), and then a restart. The
// mission that it finds must be the one that was acknowledged last, or, while
// a commit was under way, the one that this commit makes: map, positions of
// sources and contact history alike.
//
// One in eight recoveries is cut as well, at a point of its own, and must find
// the same on the second try.
//
// --synchronous-off is the negative control: SQLite then never syncs, and the
// same test must find missions that went back.
//
// Exit code: 0 nothing bad, 1 something bad, 2 misuse or a failure of the test
// itself.

#include <sqlite3.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_format.h"
#include "storage/mission_file.h"
#include "storage/restore.h"
#include "tests/fault/crash_image.h"
#include "tests/fault/expected_state.h"
#include "tests/fault/fault_disk.h"
#include "tests/storage/event_script.h"
#include "tests/storage/sample_records.h"
#include "tests/storage/temp_dir.h"

namespace fathom::fault {
namespace {

using storage::MissionFile;

constexpr char kMission[] = "m";

// A commit's place in the log of operations.
struct Span {
  std::size_t begin = 0;
  std::size_t end = 0;
};

struct Workload {
  FileSet start;
  std::vector<DiskOperation> log;
  // states[i]: the mission after i commits.
  std::vector<ExpectedState> states;
  std::vector<Span> commits;
};

void Require(const absl::Status& status) {
  if (status.ok()) return;
  absl::FPrintF(stderr, "crash_points: %s\n", status.ToString());
  std::exit(2);
}

FileSet ReadFiles(const storage::TempDir& folder) {
  FileSet files;
  for (const char* name : {"m", "m-wal"}) {
    std::ifstream file(folder.File(name), std::ios::binary);
    if (!file) continue;
    files[name] = FileBytes(std::istreambuf_iterator<char>(file), {});
  }
  return files;
}

void WriteFiles(const FileSet& files, const storage::TempDir& folder) {
  for (const char* name : {"m", "m-wal", "m-shm", "m.lock"}) {
    std::remove(folder.File(name).c_str());
  }
  for (const auto& [name, bytes] : files) {
    std::ofstream file(folder.File(name), std::ios::binary);
    file.write(reinterpret_cast<const char*>(bytes.data()),
               static_cast<std::streamsize>(bytes.size()));
  }
}

// Commits, log copies, checkpoints and clean restarts in a random order.
Workload RunWorkload(std::uint64_t seed, int commits) {
  const storage::TempDir folder;
  const std::string path = folder.File(kMission);
  Workload work;
  auto file = MissionFile::Create(path, storage::SampleMetadata());
  Require(file.status());
  Require((*file)->Close());
  work.start = ReadFiles(folder);
  file->reset();

  FaultDisk& disk = FaultDisk::Get();
  disk.StartLog();
  file = MissionFile::Open(path);
  Require(file.status());
  map::ObstacleMap map(*storage::OptionsOf(storage::SampleMetadata()));
  storage::EventScript script(map, nullptr);
  ExpectedState state = ExpectedState::OfNew(map);
  work.states.push_back(state);
  std::mt19937_64 random(seed);
  for (int i = 0; i < commits; ++i) {
    for (auto events = 1 + random() % 5; events > 0; --events) script.Step();
    if (random() % 8 == 0) script.Checkpointed();
    const std::size_t begin = disk.log().size();
    Require((*file)->Commit(script.batch()));
    work.commits.push_back({.begin = begin, .end = disk.log().size()});
    state.Add(script.batch(), map);
    work.states.push_back(state);
    script.Committed();
    if (random() % 6 == 0) Require((*file)->CopyLog());
    if (random() % 25 == 0) {
      Require((*file)->Close());
      file->reset();
      file = MissionFile::Open(path);
      Require(file.status());
      Require((*file)->Load().status());
    }
  }
  disk.StopLog();
  work.log = disk.log();
  return work;
}

class Checker {
 public:
  explicit Checker(std::uint64_t seed) : random_(seed) {}

  // What is wrong with the mission in `files`; empty: it is `before` or
  // `after`.
  std::string Check(const FileSet& files, const ExpectedState& before,
                    const ExpectedState& after) {
    if (checks_++ % 8 != 0) return Recover(files, before, after);
    // The recovery itself is cut.
    FaultDisk& disk = FaultDisk::Get();
    disk.StartLog();
    std::string problem = Recover(files, before, after);
    disk.StopLog();
    if (!problem.empty()) return problem;
    CrashImage image(files);
    const std::size_t cut = random_() % (disk.log().size() + 1);
    for (std::size_t i = 0; i < cut; ++i) image.Apply(disk.log()[i]);
    const auto mode = static_cast<CrashMode>(random_() % kCrashModes);
    // What one recovery showed must not be gone after it.
    const ExpectedState found =
        found_revision_ == after.revision ? after : before;
    problem = Recover(image.After(mode, random_), found, found);
    ++recoveries_cut_;
    return problem.empty() ? "" : "after a cut recovery: " + problem;
  }

  std::uint64_t recoveries_cut() const { return recoveries_cut_; }

 private:
  std::string Recover(const FileSet& files, const ExpectedState& before,
                      const ExpectedState& after) {
    WriteFiles(files, folder_);
    auto found = FoundState(folder_.File(kMission));
    if (!found.ok()) return found.status().ToString();
    found_revision_ = found->revision;
    const ExpectedState& wanted =
        found->revision == after.revision ? after : before;
    return Difference(wanted, *found);
  }

  const storage::TempDir folder_;
  std::mt19937_64 random_;
  std::uint64_t checks_ = 0;
  std::uint64_t recoveries_cut_ = 0;
  std::uint64_t found_revision_ = 0;
};

struct Result {
  std::uint64_t points = 0;
  std::uint64_t operations = 0;
  std::uint64_t commits = 0;
  std::uint64_t recoveries_cut = 0;
  std::uint64_t bad = 0;
  std::vector<std::string> examples = {};
};

constexpr std::size_t kMaxExamples = 10;

void CheckWorkload(const Workload& work, std::uint64_t seed,
                   std::uint64_t wanted_points, Result& result) {
  CrashImage image(work.start);
  Checker checker(seed + 1);
  std::mt19937_64 random(seed + 2);
  std::size_t commit = 0;  // The first that had not ended.
  for (std::size_t n = 0; n <= work.log.size(); ++n) {
    if (n > 0) image.Apply(work.log[n - 1]);
    while (commit < work.commits.size() && work.commits[commit].end <= n) {
      ++commit;
    }
    const bool under_way =
        commit < work.commits.size() && work.commits[commit].begin < n;
    const ExpectedState& before = work.states[commit];
    const ExpectedState& after = work.states[commit + (under_way ? 1 : 0)];
    std::set<FileSet> seen;
    for (int mode = 0; mode < kCrashModes; ++mode) {
      const FileSet files = image.After(static_cast<CrashMode>(mode), random);
      if (!seen.insert(files).second) continue;
      ++result.points;
      const std::string problem = checker.Check(files, before, after);
      if (!problem.empty() && ++result.bad <= kMaxExamples) {
        result.examples.push_back(
            absl::StrFormat("seed %d, after operation %d of %d, mode %d: %s",
                            seed, n, work.log.size(), mode, problem));
      }
      if (result.points >= wanted_points) break;
    }
    if (result.points >= wanted_points) break;
  }
  result.operations += work.log.size();
  result.commits += work.commits.size();
  result.recoveries_cut += checker.recoveries_cut();
}

// Whatever the code asks for, nothing is ever synced.
int NeverSync(sqlite3* database, char**, const sqlite3_api_routines*) {
  sqlite3_exec(database, "PRAGMA synchronous = OFF", nullptr, nullptr, nullptr);
  return sqlite3_set_authorizer(
      database,
      [](void*, int action, const char* name, const char*, const char*,
         const char*) {
        return action == SQLITE_PRAGMA && name != nullptr &&
                       std::string(name) == "synchronous"
                   ? SQLITE_IGNORE
                   : SQLITE_OK;
      },
      nullptr);
}

int Main(int argc, char** argv) {
  CLI::App app("Power cuts after every disk operation of a mission file");
  std::uint64_t points = 20'000;
  std::uint64_t seed = 1;
  bool synchronous_off = false;
  std::string out;
  app.add_option("--points", points, "Crash points to check");
  app.add_option("--seed", seed, "Of the workload and the cuts");
  app.add_flag("--synchronous-off", synchronous_off, "The negative control");
  app.add_option("--out", out, "Result as JSON")->type_name("FILE");
  CLI11_PARSE(app, argc, argv);

  FaultDisk::Get();
  const auto start = std::chrono::steady_clock::now();
  const auto seconds = [&] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() -
                                         start)
        .count();
  };
  Result result;
  for (std::uint64_t round = seed; result.points < points; round += 1000) {
    auto* const entry = reinterpret_cast<void (*)()>(&NeverSync);
    if (synchronous_off) sqlite3_auto_extension(entry);
    const Workload work = RunWorkload(round, 60);
    if (synchronous_off) sqlite3_cancel_auto_extension(entry);
    CheckWorkload(work, round, points, result);
    absl::FPrintF(stderr, "crash points %d of %d, %d bad, %.0f s\n",
                  result.points, points, result.bad, seconds());
  }
  for (const std::string& example : result.examples) {
    absl::FPrintF(stderr, "bad: %s\n", example);
  }
  const nlohmann::ordered_json document = {
      {"test", synchronous_off ? "crash_points_control" : "crash_points"},
      {"seed", seed},
      {"points", result.points},
      {"bad", result.bad},
      {"operations", result.operations},
      {"commits", result.commits},
      {"recoveries_cut", result.recoveries_cut},
      {"seconds", seconds()}};
  if (!out.empty()) std::ofstream(out) << document.dump(2) << "\n";
  return result.bad == 0 ? 0 : 1;
}

}  // namespace
}  // namespace fathom::fault

int main(int argc, char** argv) { return fathom::fault::Main(argc, argv); }
