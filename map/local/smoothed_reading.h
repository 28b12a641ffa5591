// The depth of a cell that was never measured, drawn from measured cells near
// it at the moment somebody asks.
//
// The thesis smooths when it writes (section 4.3.3.3): each ping next to a
// cell shrinks that cell's variance, so after enough pings a cell that nobody
// measured is certain. Deviation: nothing is written; the reading is
// computed from the neighbours, so no ping counts twice, neither order nor
// merging matters, and ingest pays nothing.
//
// Model: the floor is an intrinsic random function with the power variogram
// (Matheron 1963, doi:10.2113/gsecongeo.58.8.1246)
//
//   E (z(x) - z(x'))^2 = R |x - x'|^1.5,   |x - x'| in cells
//
// between a random walk (exponent 1) and a plane (2). R comes from all pairs
// of measured cells within reach, their noise taken off, beside a weak guess
// of kTypicalSlope. From the measured cells k within eq. 4.22's reach, h_k
// cells away, each with evidence mean z_k and noise variance v_k:
//
//   weight w_k ~ 1 / (v_k + R h_k^1.5), normalised: eq. 4.24 with the unit put
//          right (it adds cells to m^2) and the asking cell's own variance,
//          the same for all, left out;
//   mean   sum w_k z_k;
//   error  sum w_k R h_k^1.5 - 1/2 sum sum w_k w_l R h_kl^1.5
//          + sum w_k^2 v_k: the variance of that mean under the variogram;
//   tau^2  variability inside the asked cell: the greater of R's own inside a
//          unit square and the scatter of the neighbours' soundings in excess
//          of their noise;
//   std^2  (error + tau^2) / s, with 4.24's scale s below 1.
//
// So it grows with distance and roughness, is less where the cell lies
// between measured ones than beside them, and any number of pings on the
// neighbours leaves R h^1.5 and tau^2.
//
// Pure and thread-safe.

#ifndef FATHOM_MAP_LOCAL_SMOOTHED_READING_H_
#define FATHOM_MAP_LOCAL_SMOOTHED_READING_H_

#include <cstdint>
#include <optional>
#include <span>

#include "map/geodesy/depth_estimate.h"
#include "map/local/evidence.h"

namespace fathom::map {

// A measured cell near the asked one.
struct MeasuredNear {
  std::int32_t north = 0;  // Cells from the asked one.
  std::int32_t east = 0;
  Evidence evidence;  // Not empty.
};

// The most measured cells that a reading draws on: more tell nothing new and
// the cost grows with their square.
inline constexpr std::size_t kMaxMeasuredNear = 12;

// The estimate (kSmoothed) from measured cells near it (at most
// kMaxMeasuredNear, the nearest); nullopt if there are none or `scale` is not
// above 0. time_s is the oldest of theirs; shoalest_m is not kept. About 20 ns
// a neighbour and 2 ns a pair.
std::optional<DepthEstimate> ReadSmoothed(std::span<const MeasuredNear> near,
                                          double scale, double cell_size_m);

}  // namespace fathom::map

#endif  // FATHOM_MAP_LOCAL_SMOOTHED_READING_H_
