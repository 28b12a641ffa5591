// How a leaf takes new knowledge, and how several answers for one cell become
// one. Private to map/global; pure.

#ifndef FATHOM_MAP_GLOBAL_FUSE_H_
#define FATHOM_MAP_GLOBAL_FUSE_H_

#include <cstdint>

#include "map/global/leaf.h"

namespace fathom::map {

// An answer at the confidence of 0.95 is FREE from this many std above a mean
// (map/query/obstacle_query.h).
inline constexpr double kFreeSigmas = 1.645;

// Independent knowledge about the depth of one cell. Land says nothing else.
struct CellEvidence {
  double mean_m = 0;
  double variance_m2 = 0;     // Of the mean.
  double variability_m2 = 0;  // Inside the cell, tau^2.
  // How many soundings made it; 0: not known (taken as several).
  std::uint32_t soundings = 0;
  float hazard_m = kNoHazard;
  std::uint32_t time_s = 0;
  bool land = false;
};

// Joins what was found at several points of one cell: the mean of the means;
// the mean of the variances (errors of neighbours are seldom independent);
// variability is the mean of the parts' own and the variance of their means
// (they are parts of the cell, not repeated looks at it); all their soundings,
// the shoalest hazard, the newest time.
//
// A shoal that fills a part must not be averaged away: where an answer from the
// joined normal could be FREE at the shoalest part's mean and chance does not
// explain it, that part becomes a hazard from where its own answer would cease
// to be FREE. With d its distance from the joined mean, v the variance of its
// mean and w that of the parts' means about the joined one, not explained is
// d^2 > q_n^2 v + 1.6^2 w, q_n the bound that the least of n normal draws
// passes once in a hundred cells (LeastOfNormals).
class EvidenceSum {
 public:
  void Add(const CellEvidence& evidence);
  bool empty() const { return count_ == 0 && land_count_ == 0; }
  // Land if at least `land_share` of what was added was land.
  // REQUIRES: !empty().
  CellEvidence Join(double land_share) const;
  // The part with the least mean, with the shoalest hazard of all.
  // REQUIRES: something that is no land was added.
  CellEvidence Shoalest() const;

 private:
  std::uint32_t count_ = 0;
  std::uint32_t land_count_ = 0;
  double origin_m_ = 0;  // The first mean: sums are about it, to keep digits.
  double sum_ = 0;
  double sum_squares_ = 0;
  double sum_variances_ = 0;
  double sum_variabilities_ = 0;
  std::uint64_t soundings_ = 0;
  float hazard_m_ = kNoHazard;
  CellEvidence shoalest_;  // The part with the least mean.
  std::uint32_t time_s_ = 0;
};

// What two bodies of evidence say together, before it is put into codes: mean
// by eq. 4.18 and variance of the mean by eq. 4.20 with the gain k of eq. 4.17,
// taking both as independent (Nervegna 2002, sections 4.3.3 and 4.4.4.3; the
// thesis chose 4.21, whose variance stops falling). Only the variance of the
// mean shrinks. Variability is averaged by weight, (1 - k) tau1^2 + k tau2^2,
// and takes up what the means' variances do not explain of their distance d:
//
//   k (1 - k) max(0, d^2 - 4 (v1 + v2))
//
// k (1 - k) d^2 is the variance between the two about the fused mean (the
// moment estimate of random effects: DerSimonian and Laird 1986,
// doi:10.1016/0197-2456(86)90046-2); up to two sigma it is taken for chance,
// which adds 4 % to the variance where they do agree. Surveys that disagree so
// leave a std that covers both, and later ones that agree outweigh it again.
// The shoalest hazard stays, the newest time. Symmetric to the last bit.
CellEvidence FuseEvidence(const CellEvidence& a, const CellEvidence& b);

// A prior and evidence: as the local map reads them (FusePrior in
// map/geodesy/depth_fusion.h), a prior that the evidence contradicts is widened
// to the contradiction. The prior counts with all its std, the variability is
// the evidence's.
CellEvidence FuseWithPrior(const CellEvidence& prior,
                           const CellEvidence& evidence);

// A leaf of its own.
Leaf MakeLeaf(LeafKind kind, const CellEvidence& evidence);

// What a leaf knows, as evidence. REQUIRES: it is prior or measured.
CellEvidence EvidenceOf(const Leaf& leaf);

// FuseWithPrior where a prior leaf is measured (`kind` is kMeasured), else
// FuseEvidence, in the leaf. The kind becomes `kind`; the residual shrinks with
// the weight that the old mean keeps. REQUIRES: the leaf is prior or measured;
// evidence is no land.
//
// Evidence is rounded to a leaf's codes before it is fused with measured
// evidence, as that was when it came: so two surveys of unknown ground give the
// same leaf in either order, bit for bit. A prior beneath, or a third survey,
// leaves a code step (tests/map/global/fuse_test.cc measures it and says why
// 12 bytes cannot do better).
void FuseLeaf(const CellEvidence& evidence, LeafKind kind, Leaf& leaf);

// A part of the leaf's cell was found to be so shoal: where the leaf's answers
// would be FREE at its mean, or it has a hazard, the leaf takes it as a hazard.
// False if nothing changed. REQUIRES: as FuseLeaf.
bool AddShoal(const CellEvidence& part, Leaf& leaf);

// What a quarter of the leaf's cell inherits: its mean lies off the leaf's by
// the variability of the leaf, of which a plane keeps a quarter in each part
// (variability goes with the square of the side), so three quarters of tau^2
// move to the variance of the mean. The predictive std, the hazard and the rest
// stay: nobody knows in which part the hazard is.
Leaf DividedLeaf(const Leaf& leaf);
// The same for evidence of a cell that is to be used `levels` deeper: what a
// leaf made of it would have handed down.
CellEvidence DividedEvidence(const CellEvidence& evidence, int levels);

}  // namespace fathom::map

#endif  // FATHOM_MAP_GLOBAL_FUSE_H_
