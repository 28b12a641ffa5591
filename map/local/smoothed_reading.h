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

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>

#include "map/geodesy/depth_estimate.h"
#include "map/local/evidence.h"

namespace fathom::map {

// The most measured cells that a reading draws on: more tell nothing new and
// the cost grows with their square.
inline constexpr std::size_t kMaxMeasuredNear = 12;

// Measured cells near the asked one, a lane each. A lane without a cell lies
// far off, apart from the others, and counts for nothing.
struct MeasuredNear {
  using Lanes = std::array<float, kMaxMeasuredNear>;

  MeasuredNear() {
    north = {2000, 2001, 2002, 2003, 2004, 2005,
             2006, 2007, 2008, 2009, 2010, 2011};
    weight = count = {1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1};
    east = mean_m = scatter = used = {};
  }

  bool full() const { return size == kMaxMeasuredNear; }

  // Adds a cell that lies that many cells (below 1000) from the asked one.
  // REQUIRES: not full; the evidence is not empty; not both 0; no cell twice.
  void Add(std::int32_t cells_north, std::int32_t cells_east,
           const Evidence& evidence) {
    north[size] = static_cast<float>(cells_north);
    east[size] = static_cast<float>(cells_east);
    mean_m[size] = evidence.mean_m;
    weight[size] = evidence.weight;
    scatter[size] = evidence.scatter;
    count[size] = static_cast<float>(evidence.count);
    used[size] = 1.0f;
    oldest_s = std::min(oldest_s, evidence.time_s);
    ++size;
  }

  Lanes north, east;
  Lanes weight, mean_m, count, scatter;  // As in Evidence.
  Lanes used;                            // 1; 0: no cell.
  std::uint32_t oldest_s = std::numeric_limits<std::uint32_t>::max();
  std::size_t size = 0;
};

// The estimate (kSmoothed) from the nearest measured cells; nullopt if there
// are none or `scale` is not above 0. time_s is the oldest of theirs;
// shoalest_m is not kept. About 0.16 us, however many there are: single
// precision, four pairs at a time; std_m is within 1e-5 of itself.
std::optional<DepthEstimate> ReadSmoothed(const MeasuredNear& near,
                                          double scale, double cell_size_m);

}  // namespace fathom::map

#endif  // FATHOM_MAP_LOCAL_SMOOTHED_READING_H_
