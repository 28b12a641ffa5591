// How good answers are, in numbers. Plain accumulators, no I/O.

#ifndef FATHOM_SIM_FEEDER_SCORE_H_
#define FATHOM_SIM_FEEDER_SCORE_H_

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace fathom::feeder {

// Depth estimates N(mean, std^2) against true depths. Calibrated ones have
// 68.3, 95.4 and 99.7 % of the truths within 1, 2 and 3 std and a mean
// normalised squared error of 1.
class DepthScore {
 public:
  // REQUIRES: std_m > 0.
  void Add(double mean_m, double std_m, double truth_m);

  std::uint64_t count() const { return count_; }
  // 0 when empty, as all below.
  double RmseM() const;
  // Mean of estimate - truth: positive reads too deep.
  double BiasM() const;
  double MeanStdM() const;
  // Share of truths with |estimate - truth| <= k std; k is 1, 2 or 3.
  double ShareWithin(int k) const;
  // Mean of ((estimate - truth) / std)^2.
  double MeanNees() const;

 private:
  std::uint64_t count_ = 0;
  double error_sum_m_ = 0.0;
  double square_sum_m2_ = 0.0;
  double std_sum_m_ = 0.0;
  double nees_sum_ = 0.0;
  std::array<std::uint64_t, 3> within_ = {};
};

// Stated probabilities against what came true.
class ReliabilityScore {
 public:
  static constexpr std::size_t kBins = 10;

  struct Bin {
    std::uint64_t count = 0;
    double stated_sum = 0.0;
    std::uint64_t came_true = 0;

    double MeanStated() const;
    double Frequency() const;
  };

  // REQUIRES: probability in [0, 1].
  void Add(double probability, bool came_true);

  std::uint64_t count() const { return count_; }
  // Mean of (probability - outcome)^2: 0 perfect, 0.25 for always 1/2.
  double Brier() const;
  // Mean over all answers of |mean stated - frequency| of their bin.
  double CalibrationError() const;
  // Bin i holds probabilities in [i/10, (i+1)/10); 1 is in the last.
  const std::array<Bin, kBins>& bins() const { return bins_; }

 private:
  std::uint64_t count_ = 0;
  double square_sum_ = 0.0;
  std::array<Bin, kBins> bins_ = {};
};

// Symmetric 2 x 2 covariance of a position, m^2.
struct PositionCovariance {
  double nn = 0.0;
  double ne = 0.0;
  double ee = 0.0;
};

// 95 % point of chi-square with 2 degrees of freedom: -2 ln 0.05.
inline constexpr double kChiSquare2At95 = 5.991464547107979;

// Normalised estimation error squared e' P^-1 e of a position: chi-square of 2
// degrees of freedom for a consistent filter (mean 2, 95 % below 5.991).
// Infinite when P is not positive definite.
double PositionNees(double north_error_m, double east_error_m,
                    const PositionCovariance& covariance);

// Positions of contacts against the true ones.
class ContactScore {
 public:
  void Add(double north_error_m, double east_error_m,
           const PositionCovariance& covariance);

  std::uint64_t count() const { return count_; }
  // Root of the mean squared distance.
  double RmseM() const;
  double MeanNees() const;
  // Share with a NEES at or below 5.991: 95 % for a consistent filter.
  double ShareWithin95() const;

 private:
  std::uint64_t count_ = 0;
  double square_sum_m2_ = 0.0;
  double nees_sum_ = 0.0;
  std::uint64_t within95_ = 0;
};

}  // namespace fathom::feeder

#endif  // FATHOM_SIM_FEEDER_SCORE_H_
