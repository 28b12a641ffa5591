// The local map of one activity: a height field of equal square cells into
// which sonar pings are fused (Nervegna 2002, section 4.3). This is the
// writer; readers use LocalMapView.
//
// Copy on write: View() hands out what is there and from then on the writer
// copies a block before it changes it, once per View(). Many pings between two
// views therefore copy a block once, and a view costs what was touched.
//
// Deterministic: the same calls in the same order give the same bits, restored
// blocks included. Not thread-safe: one thread at a time; the views it
// returned may be read by any thread meanwhile.
//
// Departures from the thesis: blocks of 16 x 16 cells instead of one array
// (untouched area is free); ellipsoid instead of eq. 4.3 and the heading
// turned by the meridian's convergence; the default estimator and smoothing
// when reading (map/local/adaptive.h, smoothed_reading.h).

#ifndef FATHOM_MAP_LOCAL_LOCAL_MAP_H_
#define FATHOM_MAP_LOCAL_LOCAL_MAP_H_

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "map/geodesy/depth_estimate.h"
#include "map/geodesy/ping.h"
#include "map/geodesy/points.h"
#include "map/local/local_block.h"
#include "map/local/local_map_options.h"
#include "map/local/local_map_view.h"

namespace fathom::map {

// What is believed of a place before this activity measures it; nullopt:
// nothing. Usually the global map's answer (4.3.2).
using PriorSource =
    std::function<std::optional<DepthEstimate>(const GeodeticPoint&)>;

class LocalMap {
 public:
  // An empty map. Errors: those of ValidateLocalMapOptions.
  static absl::StatusOr<LocalMap> Create(const LocalMapOptions& options);

  LocalMap(LocalMap&&) noexcept;
  LocalMap& operator=(LocalMap&&) noexcept;
  ~LocalMap();

  struct UpdateResult {
    std::uint32_t accepted = 0;
    RejectCounts rejects;
  };

  // Fuses the beams of a ping one by one; each bad one is refused and counted
  // by its reason, the others are not touched by that (4.3.3.1):
  //   kNotFinite     a number of the beam or the pose is NaN or infinite
  //   kBelowMinRange range <= min_range_m
  //   kAboveMaxRange range >= max_range_m
  //   kBadStd        std <= 0 or > kMaxStdM
  //   kBadDepth      depth outside [kMinDepthM, kMaxDepthM]
  //   kOutsideArea   the cell is not in the map
  //   kGated         `adaptive`: a gross shoal that waits for a second sounding
  //                  (map/local/hazard.h)
  // The first that applies in this order counts. `prior` (may be null) is
  // asked for all 256 cells of a block when the block is first touched, never
  // again; where it has no answer the configured default holds. Its positions
  // are cell centres. ping.activity is not looked at.
  UpdateResult Update(const Ping& ping, const PriorSource& prior);

  // Says that the evidence up to now is in the global map: a later transfer
  // moves only what comes after. Changes no answer of At().
  void MarkTransferred();

  // Puts back a block as a view once gave it.
  // Errors: INVALID_ARGUMENT when the index lies outside the map, and those of
  // ValidateBlock.
  absl::Status RestoreBlock(BlockIndex index, LocalBlock block);

  // The map as it is now, immutable. O(1).
  LocalMapView View();

  const LocalMapOptions& options() const;

 private:
  struct State;
  explicit LocalMap(std::unique_ptr<State> state);

  std::unique_ptr<State> state_;
};

}  // namespace fathom::map

#endif  // FATHOM_MAP_LOCAL_LOCAL_MAP_H_
