// Fuzz target: a whole mission file with bytes changed, proved and repaired.
//
// The input is a list of edits of 4 bytes: u24 position (modulo the file's
// size), u8 value. If the first byte is odd, the pages that were changed get
// right checksums again, so that the damage meets what lies behind them.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>
#include <string>

#include "storage/checked_pages.h"
#include "storage/mission_file.h"
#include "storage/offline.h"
#include "storage/restore.h"
#include "tests/fuzz/fuzz.h"
#include "tests/storage/event_script.h"
#include "tests/storage/temp_dir.h"

namespace fathom::fuzz {
namespace {

using storage::Bytes;

constexpr std::size_t kPageBytes = 8192;
constexpr std::size_t kMaxEdits = 64;

// A mission with tiles, blocks, contacts, history and journal.
class Mission {
 public:
  Mission() {
    Make();
    std::ifstream in(path(), std::ios::binary);
    image_.assign(std::istreambuf_iterator<char>(in), {});
    FATHOM_FUZZ_CHECK(image_.size() % kPageBytes == 0);
    const auto proof = storage::ProveFile(path());
    if (!proof.ok()) std::fputs(proof.status().ToString().c_str(), stderr);
    FATHOM_FUZZ_CHECK(proof.ok() && proof->problems.empty());
    digest_ = proof->digest;
  }

  void Prove(const std::uint8_t* edits, std::size_t count, bool reseal) {
    Bytes damaged = image_;
    std::set<std::size_t> pages;
    for (std::size_t i = 0; i < count; ++i, edits += 4) {
      const std::size_t at = (edits[0] | std::size_t{edits[1]} << 8 |
                              std::size_t{edits[2]} << 16) %
                             damaged.size();
      damaged[at] = edits[3];
      pages.insert(at / kPageBytes);
    }
    if (reseal) {
      for (const std::size_t page : pages) Seal(damaged, page);
    }
    Write(damaged);
    const auto proof = storage::ProveFile(path());
    // Behind right checksums a number may differ; without them nothing may.
    if (!reseal && proof.ok() && proof->problems.empty()) {
      FATHOM_FUZZ_CHECK(proof->digest == digest_);
    }
    const std::string repaired = dir_.File("repaired");
    const auto repair = storage::RepairMission(path(), repaired);
    FATHOM_FUZZ_CHECK(repair.ok() == std::filesystem::exists(repaired));
    std::filesystem::remove(repaired);
  }

 private:
  std::string path() const { return dir_.File("m"); }

  void Make() const {
    const auto file =
        storage::MissionFile::Create(path(), storage::SampleMetadata());
    FATHOM_FUZZ_CHECK(file.ok());
    map::ObstacleMap map(*storage::OptionsOf(storage::SampleMetadata()));
    storage::EventScript script(map, nullptr);
    for (int i = 0; i < 150; ++i) {
      script.Step();
      FATHOM_FUZZ_CHECK((*file)->Commit(script.batch()).ok());
      script.Committed();
    }
    FATHOM_FUZZ_CHECK((*file)->Close().ok());
  }

  void Write(const Bytes& bytes) const {
    std::ofstream out(path(), std::ios::binary | std::ios::trunc);
    out.write(reinterpret_cast<const char*>(bytes.data()),
              static_cast<std::streamsize>(bytes.size()));
  }

  static void Seal(Bytes& file, std::size_t page) {
    std::uint8_t* const begin = file.data() + page * kPageBytes;
    const std::size_t content = kPageBytes - storage::kPageChecksumBytes;
    const std::uint32_t sum =
        storage::PageChecksum(static_cast<std::uint32_t>(page + 1),
                              storage::ByteSpan(begin, content));
    for (std::size_t i = 0; i < 4; ++i) {
      begin[content + i] = static_cast<std::uint8_t>(sum >> (8 * i));
    }
  }

  const storage::TempDir dir_;
  Bytes image_;
  std::string digest_;
};

}  // namespace
}  // namespace fathom::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes,
                                      std::size_t size) {
  static fathom::fuzz::Mission mission;
  if (size < 5) return 0;
  const std::size_t edits = (size - 1) / 4;
  if (edits > fathom::fuzz::kMaxEdits) return 0;
  mission.Prove(bytes + 1, edits, bytes[0] % 2 == 1);
  return 0;
}
