#include "client/cli/value_scale.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_format.h"

namespace fathom::client::cli {
namespace {

constexpr double kLogarithmicSpan = 30;

}  // namespace

double RoundStep(double value) {
  const double power = std::pow(10, std::floor(std::log10(value)));
  for (const double factor : {5.0, 2.0}) {
    if (factor * power <= value * (1 + 1e-9)) return factor * power;
  }
  return power;
}

ValueScale::ValueScale(double low, double high, bool logarithmic)
    : low_(low), high_(high), logarithmic_(logarithmic) {}

ValueScale ValueScale::Covering(const std::vector<float>& values,
                                double low_quantile, double high_quantile,
                                bool allow_logarithmic) {
  std::vector<float> known;
  for (const float value : values) {
    if (std::isfinite(value)) known.push_back(value);
  }
  if (known.empty()) return ValueScale(0, 1, false);
  const auto quantile = [&known](double q) {
    const auto at =
        static_cast<std::ptrdiff_t>(q * static_cast<double>(known.size() - 1));
    std::nth_element(known.begin(), known.begin() + at, known.end());
    return static_cast<double>(known[static_cast<std::size_t>(at)]);
  };
  double low = quantile(low_quantile);
  double high = quantile(high_quantile);
  if (allow_logarithmic && low > 0 && high / low > kLogarithmicSpan) {
    return ValueScale(std::pow(10, std::floor(std::log10(low))),
                      std::pow(10, std::ceil(std::log10(high))), true);
  }
  if (high - low < 1e-3 * std::max(std::abs(high), 1e-2)) {
    const double half = std::max(0.5 * std::abs(high), 0.05);
    low -= half;
    high += half;
  }
  const double step = RoundStep((high - low) / 5);
  low = std::floor(low / step + 1e-9) * step;
  high = std::ceil(high / step - 1e-9) * step;
  return ValueScale(low, high, false);
}

double ValueScale::Place(double value) const {
  if (logarithmic_) {
    return std::log(std::max(value, low_ * 1e-6) / low_) /
           std::log(high_ / low_);
  }
  return (value - low_) / (high_ - low_);
}

std::vector<double> ValueScale::Ticks(int most) const {
  std::vector<double> ticks;
  if (logarithmic_) {
    const bool finer = std::log10(high_ / low_) * 3 <= most;
    for (double power = low_; power < high_ * 1.001; power *= 10) {
      for (const double factor : {1.0, 2.0, 5.0}) {
        if (factor > 1 && !finer) continue;
        if (power * factor <= high_ * 1.001) ticks.push_back(power * factor);
      }
    }
    return ticks;
  }
  double step = RoundStep((high_ - low_) / most);
  while ((high_ - low_) / step > most + 0.5) step = RoundStep(step * 2.6);
  for (double i = std::ceil(low_ / step - 1e-6);
       i * step <= high_ + 1e-6 * step; ++i) {
    ticks.push_back(i * step);
  }
  return ticks;
}

std::string ValueScale::TickText(double value) {
  return std::abs(value) < 1e-9 ? "0" : absl::StrFormat("%.6g", value);
}

}  // namespace fathom::client::cli
