// Seeded fractal relief: the roughness that a coarse chart lacks.
//
// A stationary Gaussian field after Goff and Jordan 1988 ("Stochastic
// modeling of seafloor morphology", doi:10.1029/JB093iB11p13589): von Karman
// covariance
//   C(d) = std^2 2^(1-H) / Gamma(H) (d/L)^H K_H(d/L)
// with correlation length L and Hurst exponent H (fractal dimension 3 - H).
// Drawn spectrally: z(x) = std sqrt(2/M) sum_i cos(k_i . x + phase_i) with
// uniform phases and directions. In two dimensions the von Karman spectrum
// has the closed radial distribution F(k) = 1 - (1 + k^2 L^2)^-H, which is
// inverted exactly: k = sqrt((1 - u)^(-1/H) - 1) / L.
//
// Waves shorter than `shortest_m` are folded to it: a grid cannot carry them.
// Immutable after construction; thread-safe.

#ifndef FATHOM_SIM_FEEDER_RELIEF_H_
#define FATHOM_SIM_FEEDER_RELIEF_H_

#include <cstdint>
#include <vector>

namespace fathom::feeder {

struct ReliefOptions {
  std::uint64_t seed = 1;
  // 1 sigma of the field, metres, >= 0.
  double std_m = 2.0;
  // L, metres, > 0.
  double correlation_length_m = 400.0;
  // H in (0, 1]: 1 smooth, 0 rough. Goff and Jordan find 0.5 to 1.
  double hurst = 0.8;
  // Shortest wave, metres, > 0.
  double shortest_m = 20.0;
  // M: how many waves are summed. The covariance of one drawing is right to
  // about 1 / sqrt(M).
  int waves = 512;
};

class Relief {
 public:
  explicit Relief(const ReliefOptions& options);

  // What to add to the depth at a place, metres, zero mean.
  // Cost: one cosine per wave, about 5 us for 512.
  double At(double north_m, double east_m) const;

 private:
  struct Wave {
    double north_rad_m;
    double east_rad_m;
    double phase_rad;
  };
  std::vector<Wave> waves_;
  double amplitude_m_;
};

}  // namespace fathom::feeder

#endif  // FATHOM_SIM_FEEDER_RELIEF_H_
