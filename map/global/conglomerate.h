// The joining of four sibling leaves, apart from the tree in which it happens.
// Private to map/global; pure.

#ifndef FATHOM_MAP_GLOBAL_CONGLOMERATE_H_
#define FATHOM_MAP_GLOBAL_CONGLOMERATE_H_

#include <array>
#include <optional>
#include <span>

#include "map/global/global_map.h"
#include "map/global/leaf.h"
#include "map/global/work_tree.h"

namespace fathom::map {

// The leaf that may replace four siblings under a rule, or nullopt if they must
// stay. See MergeRule and GlobalMap::Conglomerate.
//
// kRange, with lo and hi the ends of the range of all means that the four
// stand for (each its depth -+ its residual): the value is (lo + hi) / 2, the
// residual (hi - lo) / 2 must not pass the tolerance. Variance of the mean by
// moments about it, variability the mean of the four's. Hazards: leaves that
// know one join only with such, and keep the shoalest; so a hazard stays as
// small as it was found, at the price of at most three leaves a level. As the
// residual is kept and only ever rounded up, the bound holds over any number of
// rounds.
std::optional<Leaf> JoinFour(const std::array<Leaf, 4>& four, MergeRule rule,
                             float tolerance_m);

// Joins all that can be joined below a node, from the leaves up, but nothing
// that touches one of `kept`. Returns the number of merges. Nodes that were
// frozen are frozen again.
std::uint64_t ConglomerateTree(WorkTree& tree, MergeRule rule,
                               std::span<const LatticeBox> kept);

}  // namespace fathom::map

#endif  // FATHOM_MAP_GLOBAL_CONGLOMERATE_H_
