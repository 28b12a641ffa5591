// Leaf: what one cell of the global map holds, and the codes it is kept in.
//
// The thesis's cell takes 128 bytes (section 6.1.2); a leaf here takes 6 to 11
// (see tile.h). What is kept is exactly what is stored: codes go to disk as
// they are, so a map read back is bit-identical.
//
// std_code, 16 bits:
//   bits 15-14  kind: 0 no value, 1 prior, 2 measured, 3 land
//   bits 13-0   standard deviation of the mean as a float without sign, 5 bits
//               of exponent (least 2^-10) and 9 of mantissa: 2^-10 m (about 1
//               mm) to 1024 m in steps of 0.1-0.2 %, decoded with one shift.
//               Zero if no value.
// spread_code, 8 bits: the predictive std (mean and variability inside the cell
//   together) over that of the mean, in steps of 2^(1/40) = 1.75 %, to nearest;
//   0: 1, no variability is known. So a fusion weighs with a precise weight,
//   and the answer's std is right to 0.9 %.
// residual_code, 8 bits: how far, at most, any fine mean that this leaf
//   replaced lies from depth_m, and how much deeper than that leaf's its
//   answers may be free; in 1/255 of the map's tolerance, rounded up.
// hazard_m, a float as it came (DepthEstimate::hazard_m); +infinity: none.
//
// Pure functions and plain values; thread-safe.

#ifndef FATHOM_MAP_GLOBAL_LEAF_H_
#define FATHOM_MAP_GLOBAL_LEAF_H_

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>

#include "map/geodesy/depth_estimate.h"

namespace fathom::map {

inline constexpr float kMinLeafStdM = 0x1p-10f;
inline constexpr float kMaxLeafStdM = 0x1p10f;
inline constexpr std::uint16_t kMaxStdBits = 20 << 9;

// Land is solid at every depth that a vessel can have. Every land leaf holds
// this one depth (above any tide) and the least std: land then merges with
// land, and a formula that overlooks the kind still answers "solid". It is no
// elevation.
inline constexpr float kLandDepthM = -100.0f;

// What a chart or an estimate may claim. Deeper than any ocean, higher than any
// shore that matters: outside it a depth is a mistake of units.
inline constexpr float kMinChartDepthM = -1000.0f;
inline constexpr float kMaxChartDepthM = 12000.0f;

enum class LeafKind : std::uint8_t {
  kUnknown = 0,
  kPrior = 1,
  kMeasured = 2,
  kLand = 3,
};

// The 14 low bits for a std, rounded to nearest and clamped to [kMinLeafStdM,
// kMaxLeafStdM]. REQUIRES: std_m is not NaN.
constexpr std::uint16_t EncodeStd(float std_m) {
  const float clamped = std::clamp(std_m, kMinLeafStdM, kMaxLeafStdM);
  const std::uint32_t bits = std::bit_cast<std::uint32_t>(clamped);
  return static_cast<std::uint16_t>(
      (bits - (std::uint32_t{127 - 10} << 23) + (1u << 13)) >> 14);
}

// The std that 14 low bits stand for; bits 15-14 are ignored.
constexpr float DecodeStd(std::uint16_t std_code) {
  return std::bit_cast<float>((std::uint32_t{std_code & 0x3fffu} << 14) +
                              (std::uint32_t{127 - 10} << 23));
}

constexpr std::uint16_t MakeStdCode(LeafKind kind, float std_m) {
  return kind == LeafKind::kUnknown
             ? std::uint16_t{0}
             : static_cast<std::uint16_t>((static_cast<unsigned>(kind) << 14) |
                                          EncodeStd(std_m));
}

// Ratios that spread codes stand for: 2^(code / 40), up to 83. Made by
// multiplication so that every machine has the same bits.
constexpr std::array<float, 256> MakeSpreadRatios() {
  std::array<float, 256> ratios{};
  double ratio = 1.0;
  for (float& entry : ratios) {
    entry = static_cast<float>(ratio);
    ratio *= 1.0174796921026863;  // 2^(1/40).
  }
  return ratios;
}
inline constexpr std::array<float, 256> kSpreadRatios = MakeSpreadRatios();

// The nearest code (in the logarithm), clamped. REQUIRES: ratio is not NaN.
constexpr std::uint8_t EncodeSpread(double ratio) {
  // Half a step down: then the first not below is the nearest.
  const double least = ratio / 1.0087019;
  const auto* const found =
      std::lower_bound(kSpreadRatios.begin(), kSpreadRatios.end() - 1, least);
  return static_cast<std::uint8_t>(found - kSpreadRatios.begin());
}

// Leaf::hazard_m where no hazard is known.
inline constexpr float kNoHazard = std::numeric_limits<float>::infinity();

// A leaf by value. One that is unknown has all fields as here.
struct Leaf {
  float depth_m = 0;
  std::uint32_t time_s = 0;  // Unix seconds of the evidence; 0: unknown.
  std::uint16_t std_code = 0;
  std::uint8_t residual_code = 0;
  std::uint8_t spread_code = 0;
  float hazard_m = kNoHazard;

  LeafKind kind() const { return static_cast<LeafKind>(std_code >> 14); }
  bool known() const { return kind() != LeafKind::kUnknown; }
  // The following REQUIRE known().
  // Of the mean alone.
  float mean_std_m() const { return DecodeStd(std_code); }
  // Predictive: mean and variability (DepthEstimate::std_m).
  float std_m() const {
    return DecodeStd(std_code) * kSpreadRatios[spread_code];
  }
  // Variability inside the cell, tau.
  float variability_m() const {
    const float ratio = kSpreadRatios[spread_code];
    return DecodeStd(std_code) * std::sqrt(ratio * ratio - 1.0f);
  }
  bool has_hazard() const { return hazard_m != kNoHazard; }

  friend bool operator==(const Leaf&, const Leaf&) = default;
};

// The greatest distance that a residual code stands for.
constexpr float DecodeResidualM(std::uint8_t residual_code, float tolerance_m) {
  return static_cast<float>(residual_code) * tolerance_m / 255.0f;
}

// The kind that the rest of the map speaks of.
constexpr EvidenceKind ToEvidenceKind(LeafKind kind) {
  switch (kind) {
    case LeafKind::kPrior:
      return EvidenceKind::kPrior;
    case LeafKind::kMeasured:
      return EvidenceKind::kMeasured;
    case LeafKind::kLand:
      return EvidenceKind::kLand;
    case LeafKind::kUnknown:
      break;
  }
  return EvidenceKind::kNone;
}

}  // namespace fathom::map

#endif  // FATHOM_MAP_GLOBAL_LEAF_H_
