// Crash points of a sender's buffer (client/spool.h): a power cut after every
// operation that it asks of the disk, in several ways each (crash_image.h), and
// then a restart. The buffer that it finds must open, hold every message that
// was synced and not released, none that was never appended, each under its own
// number, and take the next.
//
// One in eight recoveries is cut as well, at a point of its own, and must find
// the same on the second try.
//
// --no-sync is the negative control: no sync reaches the disk, and the same
// test must find messages that are gone.

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "absl/strings/str_format.h"
#include "client/spool.h"
#include "tests/fault/crash_image.h"
#include "tests/fault/crash_run.h"
#include "tests/fault/file_log.h"
#include "tests/storage/temp_dir.h"

namespace fathom::fault {
namespace {

using client::Spool;

absl::StatusOr<std::unique_ptr<Spool>> OpenIn(const storage::TempDir& folder) {
  return Spool::Open({.folder = folder.path().string(),
                      .kind = "pings",
                      .source_id = "uuv-1",
                      .epoch = 7,
                      .max_bytes = client::kLeastSpoolBytes});
}

// What may be found after a power cut from `operation` on.
struct Known {
  std::size_t operation = 0;
  std::uint64_t synced = 0;    // All of these at least,
  std::uint64_t appended = 0;  // these at most;
  std::uint64_t released = 0;  // these need not be there.
};

struct Workload {
  std::vector<DiskOperation> log;
  std::vector<std::string> messages;  // [i]: number i + 1.
  std::vector<Known> known;           // In order of operation.
};

void Require(const absl::Status& status) {
  if (status.ok()) return;
  absl::FPrintF(stderr, "spool_crash_points: %s\n", status.ToString());
  std::exit(2);
}

// One in twelve is half a segment (16 MiB / 8 / 2): segments come and go.
std::string RandomMessage(std::mt19937_64& random) {
  std::string message(random() % 12 == 0 ? 1 << 20 : 1 + random() % 300, '\0');
  for (std::size_t i = 0; i < message.size(); i += 1 + random() % 64) {
    message[i] = static_cast<char>(random());
  }
  return message;
}

// Messages, syncs, what a server has, and restarts in a random order.
Workload RunWorkload(std::uint64_t seed, int steps, bool never_sync) {
  const storage::TempDir folder;
  std::mt19937_64 random(seed);
  Workload work;
  FileLog log(folder.path().string(), never_sync);
  Known known;
  // Before and after each call: what it may have done, what it has done.
  const auto note = [&] {
    known.operation = log.operations().size();
    work.known.push_back(known);
  };
  note();
  auto spool = OpenIn(folder);
  Require(spool.status());
  for (int i = 0; i < steps; ++i) {
    const auto choice = random() % 20;
    if (choice < 12) {
      work.messages.push_back(RandomMessage(random));
      ++known.appended;
      note();
      const absl::Status status = (*spool)->Append(work.messages.back());
      if (absl::IsResourceExhausted(status)) {
        --known.appended;
        work.messages.pop_back();
      } else {
        Require(status);
      }
    } else if (choice < 16) {
      Require((*spool)->Sync());
    } else if (choice < 19) {
      // The server has only what was sent, and only what was synced is.
      known.released += random() % (known.synced - known.released + 1);
      note();
      Require((*spool)->Release(known.released));
    } else {
      spool->reset();
      spool = OpenIn(folder);
      Require(spool.status());
    }
    known.synced = std::max(known.synced, (*spool)->synced_sequence());
    note();
  }
  work.log = log.operations();
  return work;
}

class Checker {
 public:
  Checker(const Workload& work, std::uint64_t seed)
      : work_(work), random_(seed) {}

  // What is wrong with the buffer in `files`; empty: nothing.
  std::string Check(const FileSet& files, const Known& known) {
    if (checks_++ % 8 != 0) return Recover(files, known);
    // The recovery itself is cut. What it showed may have been sent.
    std::vector<DiskOperation> operations;
    Known found = known;
    {
      WriteFiles(files);
      FileLog log(folder_.path().string(), /*never_sync=*/false);
      const auto spool = OpenIn(folder_);
      if (!spool.ok()) return spool.status().ToString();
      operations = log.operations();
      found.synced = (*spool)->last_sequence();
    }
    CrashImage image(files);
    const std::size_t cut = random_() % (operations.size() + 1);
    for (std::size_t i = 0; i < cut; ++i) image.Apply(operations[i]);
    const auto mode = static_cast<CrashMode>(random_() % kCrashModes);
    const std::string problem = Recover(
        image.After(mode, random_), cut == operations.size() ? found : known);
    ++recoveries_cut_;
    return problem.empty() ? "" : "after a cut recovery: " + problem;
  }

  std::uint64_t recoveries_cut() const { return recoveries_cut_; }

 private:
  void WriteFiles(const FileSet& files) const {
    for (const auto& entry :
         std::filesystem::directory_iterator(folder_.path())) {
      std::filesystem::remove(entry);
    }
    for (const auto& [name, bytes] : files) {
      std::ofstream file(folder_.File(name), std::ios::binary);
      file.write(reinterpret_cast<const char*>(bytes.data()),
                 static_cast<std::streamsize>(bytes.size()));
    }
  }

  std::string Recover(const FileSet& files, const Known& known) {
    WriteFiles(files);
    auto spool = OpenIn(folder_);
    if (!spool.ok()) return spool.status().ToString();
    const std::uint64_t first = (*spool)->first_sequence();
    const std::uint64_t last = (*spool)->last_sequence();
    if (last < known.synced || last > known.appended ||
        first > known.released + 1) {
      return absl::StrFormat(
          "messages %d to %d; synced %d, appended %d, released %d", first, last,
          known.synced, known.appended, known.released);
    }
    std::string problem = Compare(**spool, first, last, "");
    if (!problem.empty() || checks_ % 4 != 0) return problem;
    if (const absl::Status status = (*spool)->Append("next"); !status.ok()) {
      return status.ToString();
    }
    spool->reset();
    spool = OpenIn(folder_);
    if (!spool.ok()) return "with one more: " + spool.status().ToString();
    problem = Compare(**spool, first, last, "next");
    return problem.empty() ? "" : "with one more: " + problem;
  }

  // Whether exactly these messages are there, and then `more`, unless empty.
  std::string Compare(Spool& spool, std::uint64_t first, std::uint64_t last,
                      const std::string& more) const {
    std::string message;
    for (std::uint64_t number = first;; ++number) {
      const absl::StatusOr<bool> read = spool.Read(message);
      if (!read.ok()) return read.status().ToString();
      if (!*read) {
        const std::uint64_t end = last + (more.empty() ? 1 : 2);
        if (number == end) return "";
        return absl::StrFormat("ends before message %d, not %d", number, end);
      }
      if (message != (number <= last ? work_.messages[number - 1] : more)) {
        return absl::StrFormat("message %d is another", number);
      }
    }
  }

  const Workload& work_;
  const storage::TempDir folder_;
  std::mt19937_64 random_;
  std::uint64_t checks_ = 0;
  std::uint64_t recoveries_cut_ = 0;
};

void Round(std::uint64_t seed, bool no_sync, CrashTally& tally) {
  const Workload work = RunWorkload(seed, 120, no_sync);
  Checker checker(work, seed + 1);
  std::size_t at = 0;
  CutEverywhere(
      CrashImage({}), work.log, seed,
      [&](std::size_t n, const FileSet& files) {
        while (at + 1 < work.known.size() &&
               work.known[at + 1].operation <= n) {
          ++at;
        }
        return checker.Check(files, work.known[at]);
      },
      tally);
  tally.units += work.messages.size();
  tally.recoveries_cut += checker.recoveries_cut();
}

}  // namespace
}  // namespace fathom::fault

int main(int argc, char** argv) {
  return fathom::fault::CrashPointsMain(
      argc, argv,
      {.what = "Power cuts after every disk operation of a sender's buffer",
       .name = "spool_crash_points",
       .unit = "messages",
       .control_flag = "--no-sync",
       .round = fathom::fault::Round});
}
