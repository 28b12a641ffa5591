#include "sim_feeder/relief.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "sim_feeder/random.h"

namespace fathom::feeder {

Relief::Relief(const ReliefOptions& options)
    : amplitude_m_(options.std_m * std::sqrt(2.0 / options.waves)) {
  Random random(options.seed, RandomStream::kRelief);
  const double largest_rad_m = 2.0 * std::numbers::pi / options.shortest_m;
  waves_.reserve(static_cast<std::size_t>(options.waves));
  for (int i = 0; i < options.waves; ++i) {
    const double tail = 1.0 - random.Uniform();  // In (0, 1].
    const double wave_number_rad_m = std::min(
        largest_rad_m, std::sqrt(std::pow(tail, -1.0 / options.hurst) - 1.0) /
                           options.correlation_length_m);
    const double direction_rad = random.Uniform(0.0, 2.0 * std::numbers::pi);
    const double phase_rad = random.Uniform(0.0, 2.0 * std::numbers::pi);
    waves_.push_back({wave_number_rad_m * std::cos(direction_rad),
                      wave_number_rad_m * std::sin(direction_rad), phase_rad});
  }
}

double Relief::At(double north_m, double east_m) const {
  double sum = 0.0;
  for (const Wave& wave : waves_) {
    sum += std::cos(wave.north_rad_m * north_m + wave.east_rad_m * east_m +
                    wave.phase_rad);
  }
  return amplitude_m_ * sum;
}

}  // namespace fathom::feeder
