// Charts in: any raster that GDAL reads, as blocks of depth, std and land on a
// regular grid of WGS 84 latitude and longitude (a DepthTile of the contract).
//
// Grid. A north-up raster in geographic coordinates on WGS 84 keeps its own
// cells, one for one. Any other one is read at the middles of cells a little
// smaller than its own, each taking the source cell that it falls into: so
// fine that every source cell is taken at least once, however it is rotated
// (raster_source.h), so that no lone rock falls between two middles. No value
// is ever interpolated. Longitudes may run 0 to 360 or cross the antimeridian.
//
// Depth. Values are turned to metres below the datum, positive down; whether
// they are elevations or depths is stated by the caller or decided from the
// metadata (raster_sign.h), and summary() says which and why. The file's
// vertical datum is taken to be the mission's.
//
// Unknown: nodata and masked cells, values that are not finite or lie outside
// [-12 000, 12 000] m, and common sentinels that the file forgot to declare.
// Land: cells higher than land_above_m. Neither ever becomes depth 0.
//
// Std: one sigma, from a number, from a band, or from a band that states 95 %
// (divided by 1.96): as the caller says, or as a BAG's metadata says, else one
// sigma is assumed, and summary() says which. A raster without any is refused.
//
// Memory: bounded by the block read and GDAL's cache (raster_open.h), whatever
// the size of the raster. Empty parts of sparse files are not read.
//
// Thread safety: one thread at a time. GDAL's errors and exceptions are caught
// here; every error returned is marked as the file's fault.

#ifndef FATHOM_CLIENT_CLI_RASTER_H_
#define FATHOM_CLIENT_CLI_RASTER_H_

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "client/cli/arguments.h"
#include "client/cli/raster_grid.h"
#include "client/cli/raster_sign.h"
#include "fathom/v1/mission_service.pb.h"

namespace fathom::client::cli {

// Half the width of a normal distribution's central 95 %, in sigmas.
inline constexpr double kSigmasOf95Percent = 1.959964;

// Cells outside +- this are no depths: the deepest place is 10 935 m, the
// highest 8 849 m.
inline constexpr double kMaxPlausibleM = 12'000;

struct RasterOptions {
  std::string path = "";
  // 1-based; 0: the one described as elevation or depth, else the first.
  int depth_band = 0;
  Positive positive = Positive::kAuto;
  // One std for all cells, or, beside std_band, for cells without their own.
  std::optional<double> std_m = std::nullopt;
  // 1-based; 0: the one described as uncertainty, if std_m is absent.
  int std_band = 0;
  // The band states 95 % confidence rather than one sigma.
  bool std_is_95_percent = false;
  // Higher than this above the datum is land, metres.
  double land_above_m = 0;
  // Of a variable-resolution BAG, only the coarse overview grid.
  bool overview_grid = false;
  // "EPSG:32619": instead of what the file says, or where it says nothing.
  std::string crs = "";
  // Leave cells out that lie outside.
  std::optional<GeoBox> clip = std::nullopt;
};

// What was found and decided, for people.
struct RasterSummary {
  std::string driver;
  std::string crs;
  int source_columns = 0;
  int source_rows = 0;
  Positive positive = Positive::kUp;
  std::string positive_reason;
  std::string std_source;
  // Anything else worth knowing: guesses made, bands chosen.
  std::vector<std::string> remarks;
};

// Cells of all tiles read so far.
struct RasterCounts {
  std::uint64_t with_depth = 0;
  std::uint64_t land = 0;
  std::uint64_t unknown = 0;
  // Of unknown: had a value that is no depth, or no std.
  std::uint64_t implausible = 0;
  std::uint64_t without_std = 0;
};

class DepthRaster {
 public:
  // Opens and looks at a sample of the values. Errors: NOT_FOUND (no such
  // file, or no format that GDAL knows); INVALID_ARGUMENT (no coordinate
  // reference system, no such band, no std, every cell nodata, every cell
  // land, sign not to be told, nothing inside `clip`; each says which flag
  // would help); DATA_LOSS (damaged or cut off).
  static absl::StatusOr<std::unique_ptr<DepthRaster>> Open(
      const RasterOptions& options);

  virtual ~DepthRaster() = default;

  // The grid that is read, clipped.
  virtual const LonLatGrid& grid() const = 0;
  virtual const RasterSummary& summary() const = 0;
  virtual const RasterCounts& counts() const = 0;
  // The files that the raster is read from.
  virtual std::vector<std::string> files() const = 0;

  // Reads a block of grid(). Land cells have depth NaN; unknown ones too, and
  // land 0. `land` is empty if there is none; depth_m is empty too where the
  // file stores nothing at all. Errors: DATA_LOSS.
  virtual absl::StatusOr<v1::DepthTile> Read(const GridBlock& block) = 0;
};

}  // namespace fathom::client::cli

#endif  // FATHOM_CLIENT_CLI_RASTER_H_
