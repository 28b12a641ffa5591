// What soundings alone say about one cell: sufficient statistics. A map keeps
// them packed (map/local/evidence_cells.h); this is what one reckons with.
//
// Each sounding is z_i with stated variance s_i^2, weight w_i = 1 / s_i^2. The
// cell holds sum w, the weighted mean and the weighted scatter about it. From
// these every estimator but `nervegna` computes its answer when it is asked,
// so nothing of the prior is mixed in and evidence of two vehicles, or of
// before and after a transfer, merges exactly: any order and any grouping
// gives the same numbers up to rounding of the floats.
//
// Single precision is enough: at 100 m depth a float resolves 8 um, and the
// mean is updated by differences. Stated standard deviations below kMinStdM
// count as kMinStdM, so that no weight overflows and no sounding is absolute.
//
// Source: weighted Welford update (West 1979, doi:10.1145/359146.359153) and
// pairwise merge (Chan, Golub, LeVeque 1983,
// doi:10.1080/00031305.1983.10483115).

#ifndef FATHOM_MAP_LOCAL_EVIDENCE_H_
#define FATHOM_MAP_LOCAL_EVIDENCE_H_

#include <algorithm>
#include <cstdint>
#include <limits>

namespace fathom::map {

// The least standard deviation a sounding is taken for: 1 mm, an order below
// the best echo sounder and the least the global map can store.
inline constexpr float kMinStdM = 1e-3f;

// The most soundings a cell counts: see Evidence::count.
inline constexpr std::uint32_t kMaxCount = 32'767;

struct Evidence {
  float weight = 0.0f;   // Sum of 1 / s_i^2, 1/m^2; 0: no sounding.
  float mean_m = 0.0f;   // Weighted mean depth; 0 while weight is 0.
  float scatter = 0.0f;  // Sum of w_i (z_i - mean)^2, without unit: chi-square
                         // of count - 1 degrees where the soundings agree.
  // Least depth among the credible soundings (see IsCredible); NaN: none.
  float shoalest_m = std::numeric_limits<float>::quiet_NaN();
  std::uint32_t time_s = 0;  // Newest sounding, Unix seconds; 0: none.
  std::uint16_t count = 0;   // Soundings. At kMaxCount count, weight and
                             // scatter are halved: bounded, the mean stays.

  // Adds one sounding. REQUIRES: both finite, std_m > 0.
  void Add(float depth_m, float std_m, std::uint32_t sounding_time_s);

  // Of that, weight, mean_m, scatter and count alone.
  void AddMoments(float depth_m, float std_m);

  // Adds all soundings of `other`, as if each had been added.
  void Merge(const Evidence& other);

  bool empty() const { return count == 0; }
};

// Whether a single sounding may by itself set the shoalest depth of a cell:
// its 95 % uncertainty is within what IHO S-44 (edition 6) allows order 2
// surveys, sqrt(1.0^2 + (0.023 d)^2) m.
inline bool IsCredible(float depth_m, float std_m) {
  constexpr float kOrder2FixedM = 1.0f;
  constexpr float kOrder2PerDepth = 0.023f;
  const float by_depth_m = kOrder2PerDepth * depth_m;
  const float uncertainty_95_m = 1.96f * std_m;
  return uncertainty_95_m * uncertainty_95_m <=
         kOrder2FixedM * kOrder2FixedM + by_depth_m * by_depth_m;
}

// Inline, because each sounding comes this way.
inline void Evidence::AddMoments(float depth_m, float std_m) {
  const float s_m = std::max(std_m, kMinStdM);
  const float w = 1.0f / (s_m * s_m);
  if (count == kMaxCount) {
    weight *= 0.5f;
    scatter *= 0.5f;
    count = kMaxCount / 2;
  }
  const float from_old_m = depth_m - mean_m;
  if (count == 0) {
    mean_m = depth_m;
    weight = w;
    scatter = 0.0f;
  } else {
    weight += w;
    mean_m += from_old_m * (w / weight);
    scatter += w * from_old_m * (depth_m - mean_m);
  }
  ++count;
}

inline void Evidence::Add(float depth_m, float std_m,
                          std::uint32_t sounding_time_s) {
  AddMoments(depth_m, std_m);
  time_s = std::max(time_s, sounding_time_s);
  // Written so that a NaN, "none yet", gives way.
  if (!(shoalest_m <= depth_m) && IsCredible(depth_m, std_m)) {
    shoalest_m = depth_m;
  }
}

}  // namespace fathom::map

#endif  // FATHOM_MAP_LOCAL_EVIDENCE_H_
