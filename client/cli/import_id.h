// The name under which the server remembers an import (PriorHeader.import_id):
// a digest of everything that decides its tiles. So the same chart with the
// same options resumes where it broke off and changes nothing when it is
// loaded twice, wherever the file lies and whatever it is called.
//
// The digest guards against accident, not against forgery: two 64-bit hashes
// of different constants, chance of two charts meeting 2^-128.
//
// Thread-safe.

#ifndef FATHOM_CLIENT_CLI_IMPORT_ID_H_
#define FATHOM_CLIENT_CLI_IMPORT_ID_H_

#include <cstdint>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "client/cli/raster.h"
#include "fathom/v1/mission_service.pb.h"

namespace fathom::client::cli {

// Raise it when the same file and options come to give other tiles (the grid,
// the order of blocks, what is unknown): an old import must not be resumed
// with new tiles.
inline constexpr int kTilesVersion = 1;

// 128 bits of what was added, in order.
class Digest {
 public:
  void Add(std::string_view bytes);
  // With its length before it, so that "ab", "c" is not "a", "bc".
  void AddField(std::string_view field);
  // 32 hexadecimal digits.
  std::string Hex() const;

 private:
  void AddWord(std::uint64_t word);
  std::uint64_t a_ = 0x6a09e667f3bcc908;  // Fractions of sqrt(2)
  std::uint64_t b_ = 0xbb67ae8584caa73b;  // and sqrt(3).
};

// "prior-" and 32 digits: of the contents of `files`, the options, how it is
// cut (tile_cells) and what the header says of age and replacing. Reads the
// files (1 GB in about a second). Errors: NOT_FOUND, marked as the file's.
absl::StatusOr<std::string> ImportId(const RasterOptions& options,
                                     const std::vector<std::string>& files,
                                     const v1::PriorHeader& header,
                                     std::int64_t tile_cells);

}  // namespace fathom::client::cli

#endif  // FATHOM_CLIENT_CLI_IMPORT_ID_H_
