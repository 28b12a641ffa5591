// The depth of a cell that was never measured, drawn from measured cells near
// it at the moment somebody asks.
//
// The thesis smooths when it writes (section 4.3.3.3): each ping next to a
// cell shrinks that cell's variance, so after enough pings a cell that nobody
// measured is certain. Deviation: nothing is written; the reading is
// computed from the neighbours, so no ping counts twice, neither order nor
// merging matters, and ingest pays nothing.
//
// From the measured cells within eq. 4.22's reach, each with its own reading
// (mean z, predictive variance v) at n_ij cells (4.25):
//   D^2    roughness: mean square depth step per cell northward plus that
//          eastward over adjacent measured pairs, not below that of
//          kTypicalSlope;
//   weight 1 / (v + D^2 n_ij^2): eq. 4.24 with the unit put right (it adds
//          cells to m^2) and the asking cell's own variance, the same for
//          all, left out;
//   mean   the weighted mean;
//   std^2  (max v + D^2 n_min^2 + weighted variance of the z) / s.
// So it is never below any neighbour's std, grows with distance and with
// roughness, does not shrink with the number of neighbours, and s (4.24's
// scale, below 1) only widens it. The two spread terms overlap on a slope:
// that errs on the uncertain side.
//
// Pure and thread-safe.

#ifndef FATHOM_MAP_LOCAL_SMOOTHED_READING_H_
#define FATHOM_MAP_LOCAL_SMOOTHED_READING_H_

#include <cstdint>
#include <functional>
#include <optional>

#include "map/geodesy/depth_estimate.h"
#include "map/local/adaptive.h"
#include "map/local/estimator.h"
#include "map/local/placement.h"

namespace fathom::map {

// The reading of a measured cell; nullopt for one that was never measured.
using MeasuredReader =
    std::function<std::optional<DepthEstimate>(CellIndex cell)>;

// The estimate (kSmoothed) for `cell` from the measured cells inside `bounds`
// (SmoothBounds of it); nullopt if there are none or `scale` is 0. time_s is
// the oldest of theirs, shoalest_m is not kept. Costs a reading for each cell
// of the box.
std::optional<DepthEstimate> ReadSmoothed(CellIndex cell,
                                          const NeighbourBounds& bounds,
                                          double scale, double cell_size_m,
                                          const MeasuredReader& read);

}  // namespace fathom::map

#endif  // FATHOM_MAP_LOCAL_SMOOTHED_READING_H_
