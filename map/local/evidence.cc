#include "map/local/evidence.h"

#include <algorithm>
#include <cmath>

namespace fathom::map {
namespace {

// fmin ignores a NaN operand, which here means "none yet".
float ShoalerOf(float a_m, float b_m) { return std::fmin(a_m, b_m); }

}  // namespace

void Evidence::Merge(const Evidence& other) {
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

}  // namespace fathom::map
