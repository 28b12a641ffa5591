// Seeded random numbers that are the same on every machine.
//
// The C++ standard fixes the output of std::mt19937_64 but not that of its
// distributions, so the draws are our own: uniform by the upper 53 bits,
// normal by Marsaglia's polar method, chi-square by Marsaglia and Tsang's
// gamma method. With one libm the same seed gives the same bytes.
//
// A simulation draws each thing (sonar noise, passive sonar, ships, relief)
// from its own stream, so that switching one off does not change the others.
//
// Not thread-safe: one Random per thread.

#ifndef FATHOM_SIM_FEEDER_RANDOM_H_
#define FATHOM_SIM_FEEDER_RANDOM_H_

#include <cstdint>
#include <random>

namespace fathom::feeder {

// What a stream of numbers is for; a part of its seed.
enum class RandomStream : std::uint64_t {
  kSonar = 1,
  kPassiveSonar = 2,
  kShips = 3,
  kRelief = 4,
  kEvaluation = 5,
  kNavigation = 6,
  kSonarFaults = 7,
};

class Random {
 public:
  // Streams of one seed are independent (the pair is mixed by splitmix64).
  Random(std::uint64_t seed, RandomStream stream);

  // In [0, 1), a multiple of 2^-53.
  double Uniform();

  // In [low, high). REQUIRES: low <= high.
  double Uniform(double low, double high) {
    return low + (high - low) * Uniform();
  }

  // N(0, 1). Marsaglia and Bray 1964, polar method: near 1.27 trials, one
  // logarithm and one root per pair.
  double Normal();

  // N(mean, std^2). REQUIRES: std >= 0.
  double Normal(double mean, double std) { return mean + std * Normal(); }

  // Gamma(shape, scale 1). REQUIRES: shape > 0. Marsaglia and Tsang 2000,
  // "A simple method for generating gamma variables",
  // doi:10.1145/358407.358414; shape < 1 by their boost.
  double Gamma(double shape);

  // Chi-square of `degrees_of_freedom` >= 1: 2 Gamma(dof / 2).
  double ChiSquare(int degrees_of_freedom);

 private:
  std::mt19937_64 engine_;
  double spare_normal_ = 0.0;
  bool has_spare_ = false;
};

}  // namespace fathom::feeder

#endif  // FATHOM_SIM_FEEDER_RANDOM_H_
