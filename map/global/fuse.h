// How a leaf takes new knowledge, and how several answers for one cell become
// one. Private to map/global; pure.

#ifndef FATHOM_MAP_GLOBAL_FUSE_H_
#define FATHOM_MAP_GLOBAL_FUSE_H_

#include <cstdint>

#include "map/global/leaf.h"

namespace fathom::map {

// Independent knowledge about the depth of one cell, as N(mean, variance).
// Land says nothing else.
struct CellEvidence {
  double mean_m = 0;
  double variance_m2 = 0;
  std::uint32_t time_s = 0;
  bool land = false;
};

// Joins what was found at several points of one cell: the mean of the means;
// the mean of the variances plus the variance of the means (the points are
// parts of the cell, not repeated looks at it); the newest time.
class EvidenceSum {
 public:
  void Add(const CellEvidence& evidence);
  bool empty() const { return count_ == 0 && land_count_ == 0; }
  // Land if at least `land_share` of what was added was land.
  // REQUIRES: !empty().
  CellEvidence Join(double land_share) const;

 private:
  std::uint32_t count_ = 0;
  std::uint32_t land_count_ = 0;
  double origin_m_ = 0;  // The first mean: sums are about it, to keep digits.
  double sum_ = 0;
  double sum_squares_ = 0;
  double sum_variances_ = 0;
  std::uint32_t time_s_ = 0;
};

// A leaf of its own.
Leaf MakeLeaf(LeafKind kind, const CellEvidence& evidence);

// Mean by eq. 4.18 and variance by eq. 4.20 with the gain of eq. 4.17, taking
// leaf and evidence as independent (Nervegna 2002, sections 4.3.3 and 4.4.4.3;
// the thesis chose 4.21, whose variance stops falling). The kind becomes
// `kind`, the time the newer one; the residual shrinks with the weight that the
// old mean keeps. REQUIRES: the leaf is prior or measured; evidence is no land.
void FuseLeaf(const CellEvidence& evidence, LeafKind kind, Leaf& leaf);

}  // namespace fathom::map

#endif  // FATHOM_MAP_GLOBAL_FUSE_H_
