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

#include <sqlite3.h>

#include <fstream>
#include <map>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_format.h"
#include "storage/mission_file.h"
#include "storage/restore.h"
#include "tests/fault/crash_image.h"
#include "tests/fault/crash_run.h"
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

void CheckWorkload(const Workload& work, std::uint64_t seed,
                   CrashTally& tally) {
  Checker checker(seed + 1);
  std::size_t commit = 0;  // The first that had not ended.
  CutEverywhere(
      CrashImage(work.start), work.log, seed,
      [&](std::size_t n, const FileSet& files) {
        while (commit < work.commits.size() && work.commits[commit].end <= n) {
          ++commit;
        }
        const bool under_way =
            commit < work.commits.size() && work.commits[commit].begin < n;
        return checker.Check(files, work.states[commit],
                             work.states[commit + (under_way ? 1 : 0)]);
      },
      tally);
  tally.units += work.commits.size();
  tally.recoveries_cut += checker.recoveries_cut();
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

void Round(std::uint64_t seed, bool synchronous_off, CrashTally& tally) {
  auto* const entry = reinterpret_cast<void (*)()>(&NeverSync);
  if (synchronous_off) sqlite3_auto_extension(entry);
  const Workload work = RunWorkload(seed, 60);
  if (synchronous_off) sqlite3_cancel_auto_extension(entry);
  CheckWorkload(work, seed, tally);
}

}  // namespace
}  // namespace fathom::fault

int main(int argc, char** argv) {
  using namespace fathom::fault;
  FaultDisk::Get();
  return CrashPointsMain(
      argc, argv,
      {.what = "Power cuts after every disk operation of a mission file",
       .name = "crash_points",
       .unit = "commits",
       .control_flag = "--synchronous-off",
       .round = Round});
}
