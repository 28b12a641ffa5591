#include "map/local/evidence.h"

#include <algorithm>
#include <cmath>

namespace fathom::map {
namespace {

constexpr std::uint32_t kMaxCount = 65'535;

// fmin ignores a NaN operand, which here means "none yet".
float ShoalerOf(float a_m, float b_m) { return std::fmin(a_m, b_m); }

}  // namespace

void Evidence::Add(float depth_m, float std_m, std::uint32_t sounding_time_s) {
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
  time_s = std::max(time_s, sounding_time_s);
  if (IsCredible(depth_m, s_m)) shoalest_m = ShoalerOf(shoalest_m, depth_m);
}

void Evidence::Merge(const Evidence& other) {
  flags |= other.flags;
  time_s = std::max(time_s, other.time_s);
  shoalest_m = ShoalerOf(shoalest_m, other.shoalest_m);
  if (other.count == 0) return;
  if (count == 0) {
    weight = other.weight;
    mean_m = other.mean_m;
    scatter = other.scatter;
    count = other.count;
    return;
  }
  const float total = weight + other.weight;
  const float apart_m = other.mean_m - mean_m;
  scatter +=
      other.scatter + apart_m * apart_m * (weight / total) * other.weight;
  mean_m += apart_m * (other.weight / total);
  weight = total;
  std::uint32_t sum = std::uint32_t{count} + other.count;
  while (sum > kMaxCount) {
    sum /= 2;
    weight *= 0.5f;
    scatter *= 0.5f;
  }
  count = static_cast<std::uint16_t>(sum);
}

bool IsCredible(float depth_m, float std_m) {
  constexpr float kOrder2FixedM = 1.0f;
  constexpr float kOrder2PerDepth = 0.023f;
  const float by_depth_m = kOrder2PerDepth * depth_m;
  const float uncertainty_95_m = 1.96f * std_m;
  return uncertainty_95_m * uncertainty_95_m <=
         kOrder2FixedM * kOrder2FixedM + by_depth_m * by_depth_m;
}

}  // namespace fathom::map
