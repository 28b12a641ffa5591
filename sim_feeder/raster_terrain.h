// Truth terrain from raster files: whatever GDAL reads (GeoTIFF, BAG, netCDF,
// ASCII grid), first band.
//
// The only user of GDAL in this room. GDAL's objects stay inside; its errors
// come back as a status. The georeference of a projected raster holds a PROJ
// object and may be used by one thread at a time.

#ifndef FATHOM_SIM_FEEDER_RASTER_TERRAIN_H_
#define FATHOM_SIM_FEEDER_RASTER_TERRAIN_H_

#include <cstdint>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "map/geodesy/points.h"
#include "sim_feeder/relief.h"
#include "sim_feeder/terrain.h"

namespace fathom::feeder {

// Where Debian's ferret-datasets puts ETOPO5 (5 arc minutes, elevation up).
inline constexpr std::string_view kEtopo5Path =
    "/usr/share/ferret-vis/data/etopo5.cdf";

// Most cells of a raster that is read whole: 400 MB as float.
inline constexpr std::uint64_t kMaxTerrainCells = 100'000'000;

// Which way a raster's values grow.
enum class Positive {
  kAuto,  // From its metadata, else from its values; see DetectPositive.
  kUp,    // Elevations.
  kDown,  // Depths.
};

// Reads "auto", "up" or "down". Errors: INVALID_ARGUMENT.
absl::StatusOr<Positive> ParsePositive(std::string_view name);

// What of a band tells which way its values grow.
struct BandDescription {
  std::string driver = {};       // GDAL's short name, "BAG".
  std::string description = {};  // Description and long_name.
  std::string positive = {};     // CF attribute "positive": "up" or "down".
  double mean = 0.0;             // Of the valid values.
};

// In this order: the CF attribute; the BAG driver (elevation by its standard);
// the words elevation, height, altitude, relief, topograph (up) or depth,
// sounding (down) in the description, "positive_up/down" before them; a
// negative mean (up). Errors: INVALID_ARGUMENT when nothing of it tells: say
// up or down.
absl::StatusOr<Positive> DetectPositive(const BandDescription& band);

// Reads a raster whole.
//
// Errors: NOT_FOUND (no such file); INVALID_ARGUMENT (GDAL cannot read it, it
// has no coordinate system or no geotransform, or its direction cannot be
// told); RESOURCE_EXHAUSTED above kMaxTerrainCells.
absl::StatusOr<Terrain> LoadRasterTerrain(const std::string& path,
                                          Positive positive);

// A fine geographic grid over a coarse one, with relief added: what ETOPO5
// becomes near a survey. Water cells keep at least `min_water_m`, so that the
// relief makes no islands; coarse land stays as it is.
//
// Cells and relief hang on `center`, not on the window: two windows about one
// centre agree, cell for cell, where they overlap.
struct RefinedTerrainOptions {
  // Where cells and relief are counted from.
  map::GeodeticPoint center;
  // Middle of the window and half its side, metres.
  map::GeodeticPoint middle;
  double half_side_m = 2'000.0;
  double cell_size_m = 10.0;
  double min_water_m = 2.0;
  ReliefOptions relief;
};

// Errors: INVALID_ARGUMENT for sizes <= 0; RESOURCE_EXHAUSTED above 2000 x
// 2000 cells (20 s of relief); OUT_OF_RANGE when `coarse` has no value at the
// middle.
absl::StatusOr<Terrain> RefineTerrain(const Terrain& coarse,
                                      const RefinedTerrainOptions& options);

}  // namespace fathom::feeder

#endif  // FATHOM_SIM_FEEDER_RASTER_TERRAIN_H_
