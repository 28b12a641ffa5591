// Fuzz target: the files of a sender's buffer on disk (client/spool.h).
//
// The input: flags u8, size of the first of two files u16; the files one after
// the other. Flag 1: their headers get a right checksum; flag 2: so do messages
// and marks, one after the other; flag 4: there is one file alone; flag 8: they
// are named 1 and 2, not by their headers. Without that no mutation would pass
// the door.

#include "client/spool.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include "absl/strings/str_format.h"
#include "base/crc32c.h"
#include "tests/fuzz/fuzz.h"
#include "tests/storage/temp_dir.h"

namespace fathom::fuzz {
namespace {

using client::Spool;
using Files = std::vector<std::vector<std::uint8_t>>;

constexpr std::size_t kHeaderBytes = 92;
constexpr std::size_t kFrameBytes = 8;

std::uint32_t GetU32(const std::uint8_t* in) {
  return in[0] | std::uint32_t{in[1]} << 8 | std::uint32_t{in[2]} << 16 |
         std::uint32_t{in[3]} << 24;
}

void Seal(std::uint8_t* checksum, const std::uint8_t* bytes, std::size_t size) {
  const std::uint32_t crc = Crc32c({bytes, size});
  for (int i = 0; i < 4; ++i) {
    checksum[i] = static_cast<std::uint8_t>(crc >> (8 * i));
  }
}

void SealFile(std::vector<std::uint8_t>& file, unsigned flags) {
  if (file.size() < kHeaderBytes) return;
  if ((flags & 1) != 0) {
    Seal(&file[kHeaderBytes - 4], file.data(), kHeaderBytes - 4);
  }
  if ((flags & 2) == 0) return;
  for (std::size_t at = kHeaderBytes; at + kFrameBytes < file.size();) {
    const std::uint32_t word = GetU32(&file[at]);
    const std::size_t size = word == 0xFFFFFFFF ? 8 : word;
    at += kFrameBytes;
    if (size == 0 || size > file.size() - at) return;
    Seal(&file[at - 4], &file[at], size);
    at += size;
  }
}

class Folder {
 public:
  void Write(const Files& files, bool by_place) {
    paths_.clear();
    for (const auto& entry :
         std::filesystem::directory_iterator(folder_.path())) {
      std::filesystem::remove(entry);
    }
    for (std::size_t i = 0; i < files.size(); ++i) {
      std::uint64_t number = i + 1;
      if (!by_place && files[i].size() >= kHeaderBytes) {
        number = GetU32(&files[i][16]) | std::uint64_t{GetU32(&files[i][20])}
                                             << 32;
      }
      std::string path =
          folder_.File(absl::StrFormat("pings-%020d.spool", number));
      // Never two under one name.
      if (i > 0 && path == paths_[0]) path.insert(path.size() - 6, "-again");
      paths_.push_back(path);
      std::ofstream out(path, std::ios::binary);
      out.write(reinterpret_cast<const char*>(files[i].data()),
                static_cast<std::streamsize>(files[i].size()));
    }
  }
  std::vector<std::uint8_t> Read(std::size_t i) const {
    std::ifstream in(paths_[i], std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  absl::StatusOr<std::unique_ptr<Spool>> Open() const {
    return Spool::Open({.folder = folder_.path().string(),
                        .kind = "pings",
                        .source_id = "",
                        .max_bytes = client::kLeastSpoolBytes});
  }

 private:
  const storage::TempDir folder_;
  std::vector<std::string> paths_;
};

std::vector<std::string> ReadAll(Spool& spool) {
  std::vector<std::string> all;
  std::string message;
  for (;;) {
    const absl::StatusOr<bool> read = spool.Read(message);
    FATHOM_FUZZ_CHECK(read.ok());
    if (!*read) return all;
    FATHOM_FUZZ_CHECK(!message.empty());
    all.push_back(message);
  }
}

// What was opened gives all that it counts, takes one more, and is the same
// when it is opened again.
void UseIt(const Folder& folder, std::unique_ptr<Spool> spool) {
  const std::uint64_t last = spool->last_sequence();
  std::vector<std::string> all = ReadAll(*spool);
  FATHOM_FUZZ_CHECK(all.size() == last + 1 - spool->first_sequence());
  FATHOM_FUZZ_CHECK(spool->synced_sequence() == last);
  FATHOM_FUZZ_CHECK(spool->Append("one more").ok());
  FATHOM_FUZZ_CHECK(spool->Sync().ok());
  const std::uint64_t bytes = spool->bytes();
  spool.reset();
  auto again = folder.Open();
  FATHOM_FUZZ_CHECK(again.ok());
  spool = *std::move(again);
  FATHOM_FUZZ_CHECK(spool->last_sequence() == last + 1);
  FATHOM_FUZZ_CHECK(spool->bytes() == bytes);
  all.push_back("one more");
  FATHOM_FUZZ_CHECK(ReadAll(*spool) == all);
  FATHOM_FUZZ_CHECK(spool->Release(last + 1).ok());
  FATHOM_FUZZ_CHECK(spool->Clear().ok());
  FATHOM_FUZZ_CHECK(spool->last_sequence() == last + 1);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes,
                                      std::size_t size) {
  if (size < 3) return 0;
  const unsigned flags = bytes[0];
  const std::size_t first_size = bytes[1] | std::size_t{bytes[2]} << 8;
  bytes += 3;
  size -= 3;
  const std::size_t cut = (flags & 4) != 0 ? size : std::min(size, first_size);
  Files files = {{bytes, bytes + cut}};
  if ((flags & 4) == 0) files.push_back({bytes + cut, bytes + size});
  for (auto& file : files) SealFile(file, flags);

  static Folder folder;
  folder.Write(files, (flags & 8) != 0);
  auto spool = folder.Open();
  if (spool.ok()) {
    UseIt(folder, *std::move(spool));
  } else if (spool.status().message().find("was not changed") !=
             std::string_view::npos) {
    for (std::size_t i = 0; i < files.size(); ++i) {
      FATHOM_FUZZ_CHECK(folder.Read(i) == files[i]);
    }
  }
  return 0;
}

}  // namespace fathom::fuzz
