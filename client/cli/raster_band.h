// One band of an open raster, read in metres with everything that is no value
// turned into NaN. GDAL side of raster.h. Thread safety: one thread at a time.

#ifndef FATHOM_CLIENT_CLI_RASTER_BAND_H_
#define FATHOM_CLIENT_CLI_RASTER_BAND_H_

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "client/cli/gdal_edge.h"

namespace fathom::client::cli {

// Cells of a raster, and to how many they are thinned when read.
struct RasterWindow {
  int column = 0;
  int row = 0;
  int columns = 0;
  int rows = 0;
};

// What was read. Row-major from the window's first row.
struct BandCells {
  // Metres; NaN: nodata, masked, not finite, beyond the limit, or a sentinel
  // that the file did not declare.
  std::vector<float> values;
  // 1 where a finite value that was not declared nodata was refused.
  std::vector<std::uint8_t> implausible;
};

class RasterBand {
 public:
  RasterBand() = default;  // No band.

  // Band `number` (from 1). Its scale, offset and unit are applied, then the
  // values are divided by `divisor`; a unit other than metres adds a remark.
  // Errors: INVALID_ARGUMENT (no such band, complex values).
  static absl::StatusOr<RasterBand> Open(GDALDataset& dataset, int number,
                                         double divisor,
                                         std::vector<std::string>& remarks);

  explicit operator bool() const { return band_ != nullptr; }
  std::string description() const { return band_->GetDescription(); }
  GDALRasterBand& gdal() const { return *band_; }

  // Whether the file says that nothing at all is stored in `window` (sparse
  // GeoTIFF and VRT); false where it cannot tell.
  bool Empty(const RasterWindow& window) const;

  // Reads `window`, thinned to columns x rows cells; values beyond +-limit_m
  // are none. Errors: DATA_LOSS (damaged or cut off).
  absl::StatusOr<BandCells> Read(const RasterWindow& window, int columns,
                                 int rows, double limit_m) const;

 private:
  GDALRasterBand* band_ = nullptr;
  double scale_ = 1;
  double offset_ = 0;
  bool declares_nodata_ = false;
};

// Whether `text` holds one of `words`, case apart.
bool ContainsWord(std::string text, std::initializer_list<const char*> words);

}  // namespace fathom::client::cli

#endif  // FATHOM_CLIENT_CLI_RASTER_BAND_H_
