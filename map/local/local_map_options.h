// The parameters of one activity's local map, and the grid they describe.

#ifndef FATHOM_MAP_LOCAL_LOCAL_MAP_OPTIONS_H_
#define FATHOM_MAP_LOCAL_LOCAL_MAP_OPTIONS_H_

#include <cstdint>
#include <optional>

#include "absl/status/status.h"
#include "map/geodesy/points.h"
#include "map/local/estimator.h"

namespace fathom::map {

// The most cells a local map may have: 10 km x 10 km at 1 m, four times what
// domain section 4 asks. Untouched area is free, so this bounds the directory
// (1600 superblocks), not the memory; all of it measured would be 2.4 GB.
inline constexpr std::uint64_t kMaxLocalCells = 100'000'000;

// The most cells along one side: bounds long thin maps.
inline constexpr std::uint32_t kMaxLocalSideCells = 65'536;

// The farthest that smoothing may reach, in cells: a reading then looks at
// (2 * 16 + 1)^2 = 1089 cells, some 50 us.
inline constexpr std::uint32_t kMaxSmoothReach = 16;

// Depths outside are sentinels or gross errors: no sea is deeper than 11 km;
// 100 m up leaves room for cliffs and odd datums.
inline constexpr float kMinDepthM = -100.0f;
inline constexpr float kMaxDepthM = 12'000.0f;

// A sounding less certain than this tells nothing.
inline constexpr float kMaxStdM = 100.0f;

struct LocalMapOptions {
  // Origin of the grid: the outer corner of cell (0, 0).
  GeodeticPoint south_west;
  double north_extent_m = 0.0;  // > 0; rounded up to whole cells.
  double east_extent_m = 0.0;   // > 0; rounded up to whole cells.
  double cell_size_m = 0.0;     // > 0, at least 0.01.

  EstimatorKind estimator = EstimatorKind::kAdaptive;

  // A measurement counts when min_range_m < range < max_range_m (4.3.3.1).
  double min_range_m = 0.0;
  double max_range_m = 1000.0;

  // Eq. 4.22's d: how far an unmeasured cell draws on measured ones; 0: not at
  // all. For `nervegna` this is written, for the others it is read.
  double smoothing_distance_m = 0.0;
  // Eq. 4.24's s, in [0, 1).
  double smoothing_scale = 0.0;

  // What is assumed where no prior is known (4.3.2); both or neither.
  std::optional<float> default_depth_m = std::nullopt;
  std::optional<float> default_std_m = std::nullopt;

  friend bool operator==(const LocalMapOptions&,
                         const LocalMapOptions&) = default;
};

// Whether a local map can be made of these.
// Errors: INVALID_ARGUMENT naming the field, its value and its bounds.
absl::Status ValidateLocalMapOptions(const LocalMapOptions& options);

}  // namespace fathom::map

#endif  // FATHOM_MAP_LOCAL_LOCAL_MAP_OPTIONS_H_
