// Damaged mission files: flipped bits, cut files, zeroed ranges, swapped,
// repeated and random pages, in the file and in its log. Each is opened, read,
// proved and asked for its history. It must be refused with a reason, or served
// with what was left out told, or be unharmed: never a crash, never a wrong
// answer without a word. Run it under AddressSanitizer.
//
// A log that ends early is no damage: so does every log that a crash cut. It
// may give the mission as of an earlier commit, and nothing in between.
//
// Exit code: 0 nothing bad, 1 silent wrong answers, else a crash or misuse.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <vector>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "storage/mission_file.h"
#include "storage/restore.h"
#include "tests/fault/expected_state.h"
#include "tests/storage/event_script.h"
#include "tests/storage/sample_records.h"
#include "tests/storage/temp_dir.h"

namespace fathom::fault {
namespace {

namespace fs = std::filesystem;
using storage::MissionFile;

std::string ReadAll(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return std::string(std::istreambuf_iterator<char>(file), {});
}

// A mission as a program that was killed left it: a file with a checkpoint and
// history, and a log with commits behind it.
struct Sound {
  std::string file;
  std::string log;
  // The same mission after a clean end: one file.
  std::string closed;
  // After each commit.
  std::vector<ExpectedState> states;

  explicit Sound(const storage::TempDir& folder) {
    const std::string path = folder.File("sound");
    auto mission = MissionFile::Create(path, storage::SampleMetadata());
    map::ObstacleMap map(*storage::OptionsOf(storage::SampleMetadata()));
    storage::EventScript script(map, nullptr);
    ExpectedState state = ExpectedState::OfNew(map);
    states.push_back(state);
    for (int i = 0; i < 30; ++i) {
      for (int k = 0; k < 9; ++k) script.Step();
      if (i % 7 == 6) script.Checkpointed();
      if (!(*mission)->Commit(script.batch()).ok()) std::abort();
      state.Add(script.batch(), map);
      states.push_back(state);
      script.Committed();
      // From here on the log is kept.
      if (i == 22) {
        if (!(*mission)->Close().ok()) std::abort();
        mission->reset();
        mission = MissionFile::Open(path);
        if (!(*mission)->Load().ok()) std::abort();
      }
    }
    file = ReadAll(path);
    log = ReadAll(path + "-wal");
    if (!(*mission)->Close().ok()) std::abort();
    closed = ReadAll(path);
  }
};

class Damager {
 public:
  explicit Damager(std::uint64_t seed) : random_(seed) {}

  // Damages `bytes` in one way; tells which.
  std::string Damage(std::string& bytes) {
    constexpr std::size_t kPage = 8192;
    const std::size_t pages = bytes.size() / kPage;
    const auto page = [&] { return (random_() % pages) * kPage; };
    switch (random_() % 7) {
      case 0: {
        const auto flips = 1 + random_() % 8;
        for (std::uint64_t i = 0; i < flips; ++i) {
          bytes[random_() % bytes.size()] ^=
              static_cast<char>(1 << (random_() % 8));
        }
        return absl::StrFormat("%d flipped bits", flips);
      }
      case 1:
        bytes.resize(random_() % bytes.size());
        return absl::StrFormat("cut to %d bytes", bytes.size());
      case 2: {
        const std::size_t at = random_() % bytes.size();
        const std::size_t size =
            std::min<std::size_t>(1 + random_() % 9000, bytes.size() - at);
        std::fill_n(bytes.begin() + static_cast<std::ptrdiff_t>(at), size,
                    '\0');
        return absl::StrFormat("%d zeroed bytes at %d", size, at);
      }
      case 3: {
        const std::size_t a = page();
        const std::size_t b = page();
        for (std::size_t i = 0; i < kPage; ++i) {
          std::swap(bytes[a + i], bytes[b + i]);
        }
        return absl::StrFormat("pages at %d and %d swapped", a, b);
      }
      case 4: {
        const std::size_t a = page();
        const std::size_t b = page();
        bytes.replace(b, kPage, bytes.substr(a, kPage));
        return absl::StrFormat("page at %d copied to %d", a, b);
      }
      case 5: {
        const std::size_t a = page();
        for (std::size_t i = 0; i < kPage; ++i) {
          bytes[a + i] = static_cast<char>(random_());
        }
        return absl::StrFormat("page at %d random", a);
      }
      default: {
        const std::size_t at = random_() % bytes.size();
        bytes[at] = static_cast<char>(random_());
        return absl::StrFormat("byte %d replaced", at);
      }
    }
  }

  bool Half() { return random_() % 2 == 0; }

 private:
  std::mt19937_64 random_;
};

enum class Verdict { kRefused, kDegraded, kUnharmed, kWrong };

struct Judgement {
  Verdict verdict = Verdict::kRefused;
  std::string why;
};

absl::StatusOr<Judgement> Judge(const std::string& path, const Sound& sound,
                                bool log_damaged) {
  FATHOM_ASSIGN_OR_RETURN(const auto file, MissionFile::Open(path));
  FATHOM_ASSIGN_OR_RETURN(const storage::Loaded loaded, file->Load());
  FATHOM_ASSIGN_OR_RETURN(const ExpectedState found, StateOf(*file));
  FATHOM_ASSIGN_OR_RETURN(const storage::Proof proof, file->Verify());
  const bool told = !loaded.damage.empty();
  if (file->metadata() != storage::SampleMetadata()) {
    return Judgement{Verdict::kWrong, "other metadata"};
  }
  const std::size_t last = sound.states.size() - 1;
  std::string why = "another revision";
  for (std::size_t i = log_damaged ? 0 : last; i <= last; ++i) {
    ExpectedState wanted = sound.states[i];
    if (wanted.revision != found.revision) continue;
    // Left out and told: the map may lack it, all else is there.
    if (told) wanted.digest = found.digest;
    why = Difference(wanted, found);
    if (!why.empty()) break;
    if (told && proof.problems.empty()) {
      return Judgement{Verdict::kWrong, "damage that the proof does not see"};
    }
    return Judgement{told ? Verdict::kDegraded : Verdict::kUnharmed, ""};
  }
  return Judgement{Verdict::kWrong, why};
}

int Main(int argc, char** argv) {
  CLI::App app("Damaged mission files");
  std::uint64_t files = 1000;
  std::uint64_t seed = 1;
  std::string out;
  app.add_option("--files", files, "Files to damage");
  app.add_option("--seed", seed, "Of the damage");
  app.add_option("--out", out, "Result as JSON")->type_name("FILE");
  CLI11_PARSE(app, argc, argv);

  const auto begin = std::chrono::steady_clock::now();
  const storage::TempDir folder;
  const Sound sound(folder);
  Damager damager(seed);
  std::uint64_t counts[4] = {};
  for (std::uint64_t i = 0; i < files; ++i) {
    // Three of four times the closed file, else a log.
    const bool log_damaged = damager.Half() && damager.Half();
    std::string file = log_damaged ? sound.file : sound.closed;
    std::string log = log_damaged ? sound.log : "";
    const std::string what = damager.Damage(log_damaged ? log : file);
    const std::string path = folder.File("damaged");
    for (const char* end : {"-shm", ".lock"}) fs::remove(path + end);
    std::ofstream(path, std::ios::binary) << file;
    fs::remove(path + "-wal");
    if (log_damaged) std::ofstream(path + "-wal", std::ios::binary) << log;
    const auto judged = Judge(path, sound, log_damaged);
    const Verdict verdict = judged.ok() ? judged->verdict : Verdict::kRefused;
    const auto count = ++counts[static_cast<int>(verdict)];
    if (verdict == Verdict::kWrong && count <= 20) {
      absl::FPrintF(stderr, "silently wrong: %s, %s: %s\n",
                    log_damaged ? "log" : "file", what, judged->why);
    }
  }
  const std::uint64_t wrong = counts[static_cast<int>(Verdict::kWrong)];
  const nlohmann::ordered_json document = {
      {"test", "corrupt_files"},
      {"seed", seed},
      {"files", files},
      {"refused", counts[static_cast<int>(Verdict::kRefused)]},
      {"degraded", counts[static_cast<int>(Verdict::kDegraded)]},
      {"unharmed", counts[static_cast<int>(Verdict::kUnharmed)]},
      {"silent_wrong", wrong},
      {"seconds",
       std::chrono::duration<double>(std::chrono::steady_clock::now() - begin)
           .count()}};
  absl::FPrintF(stderr, "%s\n", document.dump());
  if (!out.empty()) std::ofstream(out) << document.dump(2) << "\n";
  return wrong == 0 ? 0 : 1;
}

}  // namespace
}  // namespace fathom::fault

int main(int argc, char** argv) { return fathom::fault::Main(argc, argv); }
