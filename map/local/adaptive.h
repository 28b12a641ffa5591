// The default estimator: how certain is the depth in a cell, really?
//
// Model (random effects): inside a cell the depth varies as N(mu, tau^2) and a
// sounding of stated variance s^2 reads z ~ N(mu, s^2 + tau^2). The map
// reports the predictive std, that of the depth at a place in the cell:
//
//   std^2 = variance of the mean + tau^2
//
// The mean is the weighted mean of the soundings (weights 1 / s^2), so pings
// that agree reach sigma / sqrt(n); its variance is 1 / W + tau^2 / n.
//
// tau^2 comes from three witnesses, each an estimate with a variance of its
// own, averaged by precision:
//   - the depth steps to the measured neighbours: a plane that steps g_n and
//     g_e per cell varies by (g_n^2 + g_e^2) / 12 inside one. Where the means
//     are of n soundings each, the squares hold 4 tau^2 / n more;
//   - the excess scatter of those neighbours;
//   - the cell's own scatter in excess of the stated noise (DerSimonian and
//     Laird 1986, doi:10.1016/0197-2456(86)90046-2, with equal weights), with
//     the variance 2 (s^2 + tau^2)^2 / (n - 1).
// A weak last word has kTypicalSlope. What is reported is the mean of that
// normal cut off below 0: noise that could hide a variability leaves what it
// could hide, so that nothing is ever certain to 0. Where the own scatter is
// beyond chance it stands by itself: soundings that disagree leave a std not
// below their spread. See docs/adr/0004.
//
// The prior is fused by 4.18 and 4.20, but a prior that the evidence
// contradicts is widened to the contradiction first (see FusePrior).
//
// The constants were chosen on five terrains (tests/accuracy/run). All
// functions are pure and thread-safe; about 0.1 us with eight neighbours.

#ifndef FATHOM_MAP_LOCAL_ADAPTIVE_H_
#define FATHOM_MAP_LOCAL_ADAPTIVE_H_

#include <array>
#include <cstddef>
#include <limits>

#include "map/geodesy/depth_fusion.h"
#include "map/local/evidence.h"
#include "map/local/evidence_cells.h"
#include "map/local/local_block.h"

namespace fathom::map {

// Depth change per metre that is assumed where no neighbour tells: 0.03 (1.7
// degrees), the order of shelf and estuary floors.
inline constexpr double kTypicalSlope = 0.03;

// A cell and its eight neighbours, three rows from south to north of three
// from west to east; index 4 is the cell itself. Null or of count 0: no
// evidence there.
using Neighbourhood = std::array<const PackedEvidence*, 9>;
inline constexpr std::size_t kCenter = 4;

// What the surroundings say about the variability inside a cell.
struct RegionalVariability {
  float variance_m2 = 0.0f;     // Their estimate of tau^2; noise may make it
                                // a little negative.
  float uncertainty_m4 = 0.0f;  // The variance of that estimate, > 0.
};

// From the steps between the measured cells of the neighbourhood (the centre
// included) and the neighbours' excess scatter. REQUIRES: the centre has
// soundings.
RegionalVariability VariabilityAround(const Neighbourhood& cells,
                                      double cell_size_m);

// tau^2 of a cell with this evidence. REQUIRES: !evidence.empty().
float VariabilityInside(const Evidence& evidence,
                        const RegionalVariability& around);

// Variance of the evidence's weighted mean: 1 / W + tau^2 / n.
double MeanVarianceOf(const Evidence& evidence, double variability_m2);

// The whole reading of a measured cell: mean and predictive variance. A prior
// of kind kNone or kLand is left out. REQUIRES: `evidence` is that of
// cells[kCenter], see VariabilityAround.
struct AdaptiveReading {
  MeanVariance predictive;
  double variability_m2 = 0.0;  // tau^2, a part of predictive.variance_m2.
  // hazard_m of DepthEstimate; NaN: none.
  float hazard_m = std::numeric_limits<float>::quiet_NaN();
};
AdaptiveReading ReadAdaptive(const Evidence& evidence,
                             const Neighbourhood& cells, const CellPrior& prior,
                             double cell_size_m);

}  // namespace fathom::map

#endif  // FATHOM_MAP_LOCAL_ADAPTIVE_H_
