// The n-th I/O error, the n-th full disk and the n-th refusal of memory, once
// and for good, for every n until a run meets none: opening a mission that a
// crash left (so recovery too), commits, a checkpoint, the copy of the log,
// history, SaveCopy, closing.
//
// After each run the mission must hold what was acknowledged. A commit that
// was refused for want of room or memory must have left nothing, and must go
// in once there is room, without a restart; after an I/O error no commit may
// be acknowledged any more, and the one that failed is there whole or not at
// all. A copy exists complete or not at all.
//
// Exit code: 0 nothing bad, 1 something bad, 2 misuse or a failure of the test
// itself.

#include <CLI/CLI.hpp>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "absl/strings/str_format.h"
#include "storage/mission_file.h"
#include "storage/restore.h"
#include "tests/fault/expected_state.h"
#include "tests/fault/fault_disk.h"
#include "tests/fault/memory_fault.h"
#include "tests/storage/event_script.h"
#include "tests/storage/sample_records.h"
#include "tests/storage/temp_dir.h"

namespace fathom::fault {
namespace {

namespace fs = std::filesystem;
using storage::MissionFile;

enum class Fault { kIoError, kDiskFull, kNoMemory };
constexpr const char* kFaultNames[] = {"io_error", "disk_full", "no_memory"};

void Arm(Fault fault, std::uint64_t n, bool for_good) {
  switch (fault) {
    case Fault::kIoError:
      FaultDisk::Get().FailAt(FaultKind::kIoError, n, for_good);
      break;
    case Fault::kDiskFull:
      FaultDisk::Get().FailAt(FaultKind::kDiskFull, n, for_good);
      break;
    case Fault::kNoMemory:
      FailMemoryAt(n, for_good);
      break;
  }
}

void Heal() {
  FaultDisk::Get().Heal();
  HealMemory();
}

bool HasFailed(Fault fault) {
  return fault == Fault::kNoMemory ? MemoryHasFailed()
                                   : FaultDisk::Get().has_failed();
}

// The mission that every run begins with: a checkpoint, a journal, and a log
// that was not copied.
struct Template {
  storage::TempDir folder;
  std::uint64_t revision = 0;
  ExpectedState state;

  Template() {
    const std::string path = folder.File("m");
    auto file = MissionFile::Create(path, storage::SampleMetadata());
    map::ObstacleMap map(*storage::OptionsOf(storage::SampleMetadata()));
    storage::EventScript script(map, nullptr);
    state = ExpectedState::OfNew(map);
    for (int i = 0; i < 12; ++i) {
      for (int k = 0; k < 4; ++k) script.Step();
      if (i == 5) script.Checkpointed();
      if (!(*file)->Commit(script.batch()).ok()) std::abort();
      state.Add(script.batch(), map);
      script.Committed();
    }
    revision = map.revision();
    // As a crash leaves it: copied while it is open.
    for (const char* name : {"m", "m-wal"}) {
      fs::copy_file(folder.File(name), folder.File(std::string("t.") + name));
    }
  }

  void CopyTo(const storage::TempDir& target) const {
    for (const auto& entry : fs::directory_iterator(target.path())) {
      fs::remove(entry.path());
    }
    for (const char* name : {"m", "m-wal"}) {
      fs::copy_file(folder.File(std::string("t.") + name), target.File(name));
    }
  }
};

class Run {
 public:
  Run(const Template& start, const storage::TempDir& folder)
      : start_(start),
        folder_(folder),
        acknowledged_(start.state),
        perhaps_(start.state) {}

  // The scenario under the armed fault, then the restart without it. What is
  // bad, for people; empty: nothing.
  std::string Play() {
    start_.CopyTo(folder_);
    std::string problem = Work();
    file_.reset();  // As a crash would, where Work gave up.
    Heal();
    if (!problem.empty()) return problem;
    const auto found = FoundState(folder_.File("m"));
    if (!found.ok()) return "restart: " + found.status().ToString();
    const std::string difference = Difference(
        found->revision == perhaps_.revision ? perhaps_ : acknowledged_,
        *found);
    return difference.empty() ? "" : "restart: " + difference;
  }

 private:
  std::string Judge(const std::string& name, const ExpectedState& wanted,
                    const ExpectedState& or_wanted) {
    const auto found = FoundState(folder_.File(name));
    if (!found.ok()) return name + ": " + found.status().ToString();
    const std::string difference = Difference(
        found->revision == or_wanted.revision ? or_wanted : wanted, *found);
    return difference.empty() ? "" : name + ": " + difference;
  }

  std::string Work() {
    auto file = MissionFile::Open(folder_.File("m"));
    // Refused, and untouched by it: the restart tells.
    if (!file.ok()) return "";
    file_ = *std::move(file);
    auto loaded = file_->Load();
    if (!loaded.ok()) return "";
    auto restored = storage::RestoreMap(
        *std::move(loaded), *storage::OptionsOf(storage::SampleMetadata()));
    if (!restored.ok()) return "restore: " + restored.status().ToString();
    map::ObstacleMap& map = *restored->map;
    if (map.View()->Digest() != start_.state.digest) {
      return "loaded another map without an error";
    }
    storage::EventScript script(map, restored->checkpoint);
    for (int i = 0; i < 5; ++i) {
      for (int k = 0; k < 3; ++k) script.Step();
      if (i == 2) script.Checkpointed();
      std::string problem = Commit(script.batch(), map);
      if (!problem.empty() || stopped_) return problem;
      script.Committed();
      if (i == 1 || i == 3) file_->CopyLog().IgnoreError();
      if (i == 3) {
        std::string other = ReadAndCopy();
        if (!other.empty()) return other;
      }
    }
    file_->Close().IgnoreError();
    return "";
  }

  std::string Commit(const storage::Batch& batch, map::ObstacleMap& map) {
    ExpectedState after = acknowledged_;
    after.Add(batch, map);
    absl::Status status;
    for (int attempt = 0; attempt < 4; ++attempt) {
      if (attempt == 2) Heal();  // Room again.
      status = file_->Commit(batch);
      if (!absl::IsResourceExhausted(status)) break;
    }
    if (absl::IsResourceExhausted(status)) {
      return "still refused with room: " + status.ToString();
    }
    if (status.ok()) {
      acknowledged_ = perhaps_ = after;
      return "";
    }
    stopped_ = true;
    perhaps_ = after;
    if (absl::IsInternal(status) && file_->Commit(batch).ok()) {
      return "acknowledged after an I/O error";
    }
    return "";
  }

  std::string ReadAndCopy() {
    std::vector<std::uint64_t> revisions;
    const absl::Status read = file_->ReadContactHistory(
        {.source = {"c4i"}, .contact = {"even"}}, Time::min(), Time::max(),
        [&](const storage::ContactHistoryRow& row) {
          revisions.push_back(row.revision);
          return true;
        });
    if (read.ok() && revisions != acknowledged_.history["even"]) {
      return "history read short without an error";
    }
    const std::string copy = folder_.File("copy");
    const auto saved = file_->SaveCopy(copy);
    if (!saved.ok()) return fs::exists(copy) ? "half a copy stayed" : "";
    in_copy_ = acknowledged_;
    return "";
  }

  const Template& start_;
  const storage::TempDir& folder_;
  std::unique_ptr<MissionFile> file_;
  ExpectedState acknowledged_;
  // What a failed commit may have left; else the same.
  ExpectedState perhaps_;
  // What SaveCopy said it has copied.
  std::optional<ExpectedState> in_copy_;
  bool stopped_ = false;
};

int Main(int argc, char** argv) {
  CLI::App app("Every n-th failure of the disk and of memory");
  std::string out;
  std::uint64_t stride = 1;
  std::string only;
  app.add_option("--out", out, "Result as JSON")->type_name("FILE");
  app.add_option("--stride", stride, "Take each stride-th n only");
  app.add_option("--only", only, "io_error, disk_full or no_memory");
  CLI11_PARSE(app, argc, argv);
  if (stride == 0) return 2;

  InstallMemoryFault();
  FaultDisk::Get();
  const Template start;
  const storage::TempDir folder;
  const auto begin = std::chrono::steady_clock::now();
  nlohmann::ordered_json sweeps = nlohmann::ordered_json::array();
  std::uint64_t bad = 0;
  std::uint64_t runs = 0;
  for (const Fault fault :
       {Fault::kIoError, Fault::kDiskFull, Fault::kNoMemory}) {
    const std::string name = kFaultNames[static_cast<int>(fault)];
    if (!only.empty() && only != name) continue;
    for (const bool for_good : {false, true}) {
      std::uint64_t here = 0;
      std::uint64_t bad_here = 0;
      for (std::uint64_t n = 1;; n += stride) {
        Arm(fault, n, for_good);
        const std::string problem = Run(start, folder).Play();
        const bool failed = HasFailed(fault);
        Heal();
        ++here;
        if (!problem.empty() && ++bad_here <= 10) {
          absl::FPrintF(stderr, "bad: %s %d %s: %s\n", name, n,
                        for_good ? "for good" : "once", problem);
        }
        if (!failed) break;
      }
      absl::FPrintF(stderr, "%s %s: %d runs, %d bad\n", name,
                    for_good ? "for good" : "once", here, bad_here);
      sweeps.push_back({{"fault", name},
                        {"for_good", for_good},
                        {"runs", here},
                        {"bad", bad_here}});
      bad += bad_here;
      runs += here;
    }
  }
  const nlohmann::ordered_json document = {
      {"test", "error_sweep"},
      {"stride", stride},
      {"runs", runs},
      {"bad", bad},
      {"seconds",
       std::chrono::duration<double>(std::chrono::steady_clock::now() - begin)
           .count()},
      {"sweeps", sweeps}};
  if (!out.empty()) std::ofstream(out) << document.dump(2) << "\n";
  return bad == 0 ? 0 : 1;
}

}  // namespace
}  // namespace fathom::fault

int main(int argc, char** argv) { return fathom::fault::Main(argc, argv); }
