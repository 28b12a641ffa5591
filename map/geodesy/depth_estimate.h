// What the map believes about the depth at one place. Local map, global map
// and queries all speak in this type.

#ifndef FATHOM_MAP_GEODESY_DEPTH_ESTIMATE_H_
#define FATHOM_MAP_GEODESY_DEPTH_ESTIMATE_H_

#include <cstdint>
#include <limits>

namespace fathom::map {

// From what an estimate was made. The numbers are stored: never reuse one.
enum class EvidenceKind : std::uint8_t {
  kNone = 0,      // Nothing is known; the other fields mean nothing.
  kPrior = 1,     // From a chart or raster, or a configured default.
  kSmoothed = 2,  // Never measured itself; drawn from measured neighbours.
  kMeasured = 3,  // At least one sounding fell in the cell.
  kLand = 4,      // Dry land: solid at every depth; depth_m means nothing.
};

// The top of the seabed or of an obstacle on it, as N(depth_m, std_m^2).
// Depths are below the mission's vertical datum, positive down.
struct DepthEstimate {
  float depth_m = 0.0f;
  // Predictive 1-sigma: what a new exact sounding anywhere in the cell would
  // scatter by. It holds the uncertainty of the mean and the variability of
  // the depth inside the cell together (Nervegna 2002, section 4.3).
  float std_m = 0.0f;
  EvidenceKind kind = EvidenceKind::kNone;
  // How many soundings made it; 0: not told (charts, merged evidence).
  std::uint16_t soundings = 0;
  // Unix time in seconds of the newest evidence; 0 means unknown.
  std::uint32_t time_s = 0;
  // The least depth that was credibly sounded in the cell; NaN: not kept.
  float shoalest_m = std::numeric_limits<float>::quiet_NaN();
  // Side of the cell that the estimate stands for.
  float cell_size_m = 0.0f;
  // The part of std_m that is variability inside the cell (tau), 0..std_m:
  // std_m^2 - variability_m^2 is the variance of the mean alone, and only that
  // shrinks when independent evidence of the same cell is fused.
  float variability_m = 0.0f;
  // A point hazard: from this depth down to depth_m an obstacle narrower than
  // the cell was sounded that the normal distribution above does not explain
  // (a rock, a wreck, a wall). A vehicle at hazard_m or deeper is not free
  // here whatever depth_m and std_m say. Less than depth_m; NaN: none known.
  float hazard_m = std::numeric_limits<float>::quiet_NaN();
};

}  // namespace fathom::map

#endif  // FATHOM_MAP_GEODESY_DEPTH_ESTIMATE_H_
