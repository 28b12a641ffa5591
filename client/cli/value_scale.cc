#include "client/cli/value_scale.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "absl/strings/str_format.h"

namespace fathom::client::cli {
namespace {

constexpr double kLogarithmicSpan = 30;
constexpr double kRootHigh = 200;
constexpr double kRootShallowShare = 1.0 / 30;

// The smallest of 1, 2, 5 times a power of ten that is at least `value` > 0.
double RoundUp(double value) {
  const double step = RoundStep(value);
  if (step >= value * (1 - 1e-9)) return step;
  return RoundStep(step * 2.6);
}

}  // namespace

double RoundStep(double value) {
  const double power = std::pow(10, std::floor(std::log10(value)));
  for (const double factor : {5.0, 2.0}) {
    if (factor * power <= value * (1 + 1e-9)) return factor * power;
  }
  return power;
}

std::vector<double> Multiples(double step, double low, double high) {
  // A millionth of a step forgives rounding at the ends.
  const auto first = static_cast<std::int64_t>(std::ceil(low / step - 1e-6));
  const auto last = static_cast<std::int64_t>(std::floor(high / step + 1e-6));
  std::vector<double> values;
  for (std::int64_t i = first; i <= last; ++i) {
    values.push_back(static_cast<double>(i) * step);
  }
  return values;
}

ValueScale::ValueScale(double low, double high, Kind kind)
    : low_(low), high_(high), kind_(kind) {}

ValueScale ValueScale::Covering(const std::vector<float>& values,
                                double low_quantile, double high_quantile,
                                Kind wide) {
  std::vector<float> known;
  for (const float value : values) {
    if (std::isfinite(value)) known.push_back(value);
  }
  if (known.empty()) return ValueScale(0, 1, Kind::kLinear);
  const auto quantile = [&known](double q) {
    const auto at =
        static_cast<std::ptrdiff_t>(q * static_cast<double>(known.size() - 1));
    std::nth_element(known.begin(), known.begin() + at, known.end());
    return static_cast<double>(known[static_cast<std::size_t>(at)]);
  };
  double low = quantile(low_quantile);
  double high = quantile(high_quantile);
  if (wide == Kind::kLogarithmic && low > 0 && high / low > kLogarithmicSpan) {
    return ValueScale(RoundStep(low), RoundUp(high), Kind::kLogarithmic);
  }
  if (wide == Kind::kRoot && high > kRootHigh && low > -0.02 * high &&
      quantile(0.1) < kRootShallowShare * high) {
    const double step = RoundStep(high / 5);
    return ValueScale(0, std::ceil(high / step - 1e-9) * step, Kind::kRoot);
  }
  // Hardly any difference is not blown up to the whole scale.
  if (high - low < 0.05 * std::max(std::abs(high), 0.2)) {
    const double middle = (low + high) / 2;
    const double half = std::max(0.5 * std::abs(middle), 0.05);
    low = middle - half;
    high = middle + half;
  }
  const double step = RoundStep((high - low) / 5);
  low = std::floor(low / step + 1e-9) * step;
  high = std::ceil(high / step - 1e-9) * step;
  return ValueScale(low, high, Kind::kLinear);
}

double ValueScale::Place(double value) const {
  const double share = (value - low_) / (high_ - low_);
  switch (kind_) {
    case Kind::kLogarithmic:
      return std::log(std::max(value, low_ * 1e-6) / low_) /
             std::log(high_ / low_);
    case Kind::kRoot:
      return share < 0 ? -std::sqrt(-share) : std::sqrt(share);
    case Kind::kLinear:
      break;
  }
  return share;
}

std::vector<double> ValueScale::Ticks(int most) const {
  std::vector<double> ticks;
  if (kind_ != Kind::kLinear) {
    // Round values, each far enough from the one before and from the end.
    const double spacing = 0.6 / most;
    if (kind_ == Kind::kRoot) ticks.push_back(low_);
    const double first = kind_ == Kind::kRoot ? 1e-3 * high_ : low_;
    double value = RoundUp(first);
    while (value < high_ * 0.999) {
      const bool far =
          ticks.empty() || Place(value) - Place(ticks.back()) > spacing;
      if (far && 1 - Place(value) > spacing) ticks.push_back(value);
      value = RoundUp(value * 1.001);
    }
    ticks.push_back(high_);
    return ticks;
  }
  double step = RoundStep((high_ - low_) / most);
  while ((high_ - low_) / step > most + 0.5) step = RoundStep(step * 2.6);
  return Multiples(step, low_, high_);
}

std::string ValueScale::TickText(double value) {
  return std::abs(value) < 1e-9 ? "0" : absl::StrFormat("%.6g", value);
}

}  // namespace fathom::client::cli
