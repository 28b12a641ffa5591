// What is narrower than a cell: rocks, wrecks, walls.
//
// A cell's mean and std describe its floor; a rock hit once in a hundred
// soundings is averaged away by them (charted rocks read 0.8 to 4 m too deep in
// gridded means). So the cell also keeps its shoalest credible sounding, and
// a reading tells it as a hazard where stated noise does not explain it. A
// slope is no excuse: the shoal side of a steep cell is as solid as a rock. An
// answer is never FREE at a hazard's depth or below
// (map/query/obstacle_query.h).
//
// Of one sounding that stands far above all around it two things may be true:
// a new shoal, or a gross error (0.55 m beside 90 m: a fish, a dropout). It is
// held back, counted as gated, and told as a hazard meanwhile; the next
// credible sounding at its height brings both into the map at once. Where
// kPendingSoundings more in that cell do not confirm it, it is forgotten.
//
// Pure and thread-safe.

#ifndef FATHOM_MAP_LOCAL_HAZARD_H_
#define FATHOM_MAP_LOCAL_HAZARD_H_

#include <algorithm>
#include <cstdint>

#include "map/local/evidence.h"

namespace fathom::map {

// Soundings that must have come from a cell before it can call another one
// gross, and measured neighbours that can do so together.
inline constexpr std::uint32_t kGateSoundings = 3;
inline constexpr std::uint32_t kGateNeighbours = 3;

// Soundings after which an unconfirmed shoal is forgotten: a rock that fills a
// hundredth of the cell is missed by so many once in 150.
inline constexpr std::uint32_t kPendingSoundings = 500;

// A sounding that is held back. Stored: plain data.
struct PendingShoal {
  float depth_m = 0.0f;
  float std_m = 0.0f;
  std::uint32_t time_s = 0;
  std::uint16_t cell = 0;   // Of the block, 0..255.
  std::uint16_t since = 0;  // Soundings of the cell that came after it.

  friend bool operator==(const PendingShoal&, const PendingShoal&) = default;
};
static_assert(sizeof(PendingShoal) == 16);

// Whether one sounding is out of all proportion above a floor of
// `reference_m`: by more than 10 m and more than half of the depth. False for
// a reference that is NaN.
inline bool IsGrossShoal(float depth_m, float reference_m) {
  constexpr float kLeastM = 10.0f;
  constexpr float kShare = 0.5f;
  return reference_m - depth_m > std::max(kLeastM, kShare * reference_m);
}

// Whether a second sounding, itself gross, confirms the one held back: it is
// credible and within 2 m or three stated std of both.
bool Confirms(const PendingShoal& pending, float depth_m, float std_m);

// How far above a sounding its hazard begins, in stated std: noise sinks a
// rock farther than that in one hit of 290 000 (4: of 32 000, and a chart of
// 256 rocks surveyed 123 times loses one).
inline constexpr float kHazardMarginStd = 4.5f;

// The hazard_m of a reading (see DepthEstimate), or NaN.
//
// Let z_s be the shoalest credible sounding, mean' that of the n - 1 others, s
// the typical stated std. z_s is no chance if
//   mean' - z_s > q_n s,
// q_n the bound that the least of n normal draws passes once in a hundred
// cells (Bonferroni). That mean' is itself uncertain by s / sqrt(n - 1) is
// left out, in favour of the hazard: of few soundings the others may be wrong
// too. So cells without one have a hazard once in 25 (n = 3), 57 (10), 79
// (100). Neither the cell's own scatter nor the slope around it is asked: two
// hits on a rock would excuse each other. The hazard then begins
// kHazardMarginStd s above z_s, so that noise does not sink it. Cells of one
// or two soundings always have one: all of them may be on the rock.
//
// NaN for a cell that is empty or holds no credible sounding.
float HazardDepth(const Evidence& evidence);

// Where a held-back sounding makes a hazard begin.
inline float HazardDepth(const PendingShoal& pending) {
  return pending.depth_m - kHazardMarginStd * pending.std_m;
}

}  // namespace fathom::map

#endif  // FATHOM_MAP_LOCAL_HAZARD_H_
