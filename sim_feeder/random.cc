#include "sim_feeder/random.h"

#include <cmath>

namespace fathom::feeder {
namespace {

// Steele, Lea and Flood 2014, "Fast splittable pseudorandom number
// generators": the finaliser that turns near seeds into far ones.
std::uint64_t SplitMix64(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15ULL;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31);
}

}  // namespace

Random::Random(std::uint64_t seed, RandomStream stream)
    : engine_(
          SplitMix64(SplitMix64(seed) + static_cast<std::uint64_t>(stream))) {}

double Random::Uniform() {
  return static_cast<double>(engine_() >> 11) * 0x1.0p-53;
}

double Random::Normal() {
  if (has_spare_) {
    has_spare_ = false;
    return spare_normal_;
  }
  double u = 0.0;
  double v = 0.0;
  double s = 0.0;
  do {
    u = 2.0 * Uniform() - 1.0;
    v = 2.0 * Uniform() - 1.0;
    s = u * u + v * v;
  } while (s >= 1.0 || s == 0.0);
  const double factor = std::sqrt(-2.0 * std::log(s) / s);
  spare_normal_ = v * factor;
  has_spare_ = true;
  return u * factor;
}

double Random::Gamma(double shape) {
  if (shape < 1.0) {
    // 1 - Uniform() is in (0, 1]: the power never meets zero.
    const double boost = std::pow(1.0 - Uniform(), 1.0 / shape);
    return boost * Gamma(shape + 1.0);
  }
  const double d = shape - 1.0 / 3.0;
  const double c = 1.0 / std::sqrt(9.0 * d);
  for (;;) {
    const double x = Normal();
    const double t = 1.0 + c * x;
    if (t <= 0.0) continue;
    const double v = t * t * t;
    const double u = 1.0 - Uniform();
    if (std::log(u) < 0.5 * x * x + d - d * v + d * std::log(v)) return d * v;
  }
}

double Random::ChiSquare(int degrees_of_freedom) {
  return 2.0 * Gamma(0.5 * degrees_of_freedom);
}

}  // namespace fathom::feeder
