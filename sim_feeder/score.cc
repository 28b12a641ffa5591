#include "sim_feeder/score.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace fathom::feeder {
namespace {

double Ratio(double sum, std::uint64_t count) {
  return count == 0 ? 0.0 : sum / static_cast<double>(count);
}

}  // namespace

void DepthScore::Add(double mean_m, double std_m, double truth_m) {
  const double error_m = mean_m - truth_m;
  ++count_;
  error_sum_m_ += error_m;
  square_sum_m2_ += error_m * error_m;
  std_sum_m_ += std_m;
  const double ratio = std::abs(error_m) / std_m;
  nees_sum_ += ratio * ratio;
  for (std::size_t k = 0; k < within_.size(); ++k) {
    if (ratio <= static_cast<double>(k + 1)) ++within_[k];
  }
}

double DepthScore::RmseM() const {
  return std::sqrt(Ratio(square_sum_m2_, count_));
}
double DepthScore::BiasM() const { return Ratio(error_sum_m_, count_); }
double DepthScore::MeanStdM() const { return Ratio(std_sum_m_, count_); }
double DepthScore::MeanNees() const { return Ratio(nees_sum_, count_); }
double DepthScore::ShareWithin(int k) const {
  return Ratio(static_cast<double>(within_.at(static_cast<std::size_t>(k - 1))),
               count_);
}

double ReliabilityScore::Bin::MeanStated() const {
  return Ratio(stated_sum, count);
}
double ReliabilityScore::Bin::Frequency() const {
  return Ratio(static_cast<double>(came_true), count);
}

void ReliabilityScore::Add(double probability, bool came_true) {
  const double outcome = came_true ? 1.0 : 0.0;
  ++count_;
  square_sum_ += (probability - outcome) * (probability - outcome);
  const std::size_t index = std::min(
      kBins - 1,
      static_cast<std::size_t>(probability * static_cast<double>(kBins)));
  ++bins_[index].count;
  bins_[index].stated_sum += probability;
  if (came_true) ++bins_[index].came_true;
}

double ReliabilityScore::Brier() const { return Ratio(square_sum_, count_); }

double ReliabilityScore::CalibrationError() const {
  double sum = 0.0;
  for (const Bin& bin : bins_) {
    sum += static_cast<double>(bin.count) *
           std::abs(bin.MeanStated() - bin.Frequency());
  }
  return Ratio(sum, count_);
}

double PositionNees(double north_error_m, double east_error_m,
                    const PositionCovariance& covariance) {
  const double determinant =
      covariance.nn * covariance.ee - covariance.ne * covariance.ne;
  if (!(determinant > 0.0) || !(covariance.nn > 0.0)) {
    return std::numeric_limits<double>::infinity();
  }
  return (covariance.ee * north_error_m * north_error_m -
          2.0 * covariance.ne * north_error_m * east_error_m +
          covariance.nn * east_error_m * east_error_m) /
         determinant;
}

void ContactScore::Add(double north_error_m, double east_error_m,
                       const PositionCovariance& covariance) {
  const double nees = PositionNees(north_error_m, east_error_m, covariance);
  ++count_;
  square_sum_m2_ += north_error_m * north_error_m + east_error_m * east_error_m;
  nees_sum_ += nees;
  if (nees <= kChiSquare2At95) ++within95_;
}

double ContactScore::RmseM() const {
  return std::sqrt(Ratio(square_sum_m2_, count_));
}
double ContactScore::MeanNees() const { return Ratio(nees_sum_, count_); }
double ContactScore::ShareWithin95() const {
  return Ratio(static_cast<double>(within95_), count_);
}

}  // namespace fathom::feeder
