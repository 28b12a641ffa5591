#include "client/cli/import_id.h"

#include <bit>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <vector>

#include "absl/strings/str_format.h"
#include "client/cli/exit_code.h"

namespace fathom::client::cli {
namespace {

// Odd constants of well-mixed bits (golden ratio; MurmurHash3's finaliser).
constexpr std::uint64_t kOdd1 = 0x9e3779b97f4a7c15;
constexpr std::uint64_t kOdd2 = 0xff51afd7ed558ccd;
constexpr std::uint64_t kOdd3 = 0xc4ceb9fe1a85ec53;

// Bytes read at once.
constexpr std::size_t kChunk = 1 << 20;

std::uint64_t Mixed(std::uint64_t h) {
  h = (h ^ (h >> 33)) * kOdd2;
  h = (h ^ (h >> 33)) * kOdd3;
  return h ^ (h >> 33);
}

}  // namespace

void Digest::AddWord(std::uint64_t word) {
  a_ = std::rotl((a_ ^ word) * kOdd1, 29);
  b_ = std::rotl((b_ + word) * kOdd2, 31) ^ a_;
}

void Digest::Add(std::string_view bytes) {
  std::uint64_t word = 0;
  while (bytes.size() >= sizeof word) {
    std::memcpy(&word, bytes.data(), sizeof word);
    AddWord(word);
    bytes.remove_prefix(sizeof word);
  }
  if (bytes.empty()) return;
  word = 0;
  std::memcpy(&word, bytes.data(), bytes.size());
  AddWord(word);
}

void Digest::AddField(std::string_view field) {
  AddWord(field.size());
  Add(field);
}

std::string Digest::Hex() const {
  return absl::StrFormat("%016x%016x", Mixed(a_ + b_), Mixed(a_ ^ (b_ * 3)));
}

absl::StatusOr<std::string> ImportId(const RasterOptions& options,
                                     const std::vector<std::string>& files,
                                     const v1::PriorHeader& header,
                                     std::int64_t tile_cells) {
  Digest digest;
  std::vector<char> chunk(kChunk);
  for (const std::string& file : files) {
    std::ifstream in(file, std::ios::binary);
    if (!in) {
      return FileError(
          absl::NotFoundError(absl::StrFormat("%s: cannot be opened", file)));
    }
    std::uint64_t size = 0;
    while (in.read(chunk.data(), static_cast<std::streamsize>(chunk.size())),
           in.gcount() > 0) {
      digest.Add({chunk.data(), static_cast<std::size_t>(in.gcount())});
      size += static_cast<std::uint64_t>(in.gcount());
    }
    digest.AddField(absl::StrFormat("%d", size));
  }
  // A container's part, NETCDF:"file":variable, is not the file itself.
  std::error_code ignored;
  digest.AddField(
      std::filesystem::exists(options.path, ignored) ? "" : options.path);
  digest.AddField(absl::StrFormat(
      "v%d band=%d positive=%d std_m=%.17g std_band=%d 95=%d land=%.17g "
      "overview=%d tile=%d replace=%d time=%d.%d",
      kTilesVersion, options.depth_band, static_cast<int>(options.positive),
      options.std_m.value_or(-1), options.std_band, options.std_is_95_percent,
      options.land_above_m, options.overview_grid, tile_cells, header.replace(),
      header.survey_time().seconds(), header.survey_time().nanos()));
  digest.AddField(options.crs);
  if (options.clip.has_value()) {
    digest.AddField(
        absl::StrFormat("clip %.17g %.17g %.17g %.17g", options.clip->south_deg,
                        options.clip->west_deg, options.clip->north_deg,
                        options.clip->east_deg));
  }
  return "prior-" + digest.Hex();
}

}  // namespace fathom::client::cli
