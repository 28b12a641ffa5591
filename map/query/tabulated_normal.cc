#include "map/query/tabulated_normal.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

#include "map/query/disc_probability.h"

namespace fathom::map {
namespace {

constexpr double kReach = 8.0;
constexpr double kPlacesPerUnit = 32.0;

// The distribution function and the density at -kReach, ..., kReach.
class Table {
 public:
  struct Place {
    double x;
    double cdf;
    double density;
  };

  Table() {
    for (std::size_t k = 0; k < places_.size(); ++k) {
      const double x = static_cast<double>(k) / kPlacesPerUnit - kReach;
      places_[k] = {.x = x,
                    .cdf = NormalCdf(x),
                    .density = std::exp(-0.5 * x * x) * 0.5 *
                               std::numbers::inv_sqrtpi * std::numbers::sqrt2};
    }
  }

  // The nearest place. REQUIRES: |x| < kReach.
  const Place& Near(double x) const {
    // By way of int: to the unsigned is dearer.
    return places_[static_cast<std::size_t>(static_cast<int>(
        x * kPlacesPerUnit + (kReach * kPlacesPerUnit + 0.5)))];
  }

 private:
  static constexpr std::size_t kPlaces =
      static_cast<std::size_t>(2 * kReach * kPlacesPerUnit) + 1;
  std::array<Place, kPlaces> places_;
};

}  // namespace

double TabulatedNormalCdf(double x) {
  // Written so that NaN goes this way.
  if (!(std::fabs(x) < kReach)) return NormalCdf(x);
  static const Table table;
  const Table::Place& at = table.Near(x);
  // The n-th derivative of the density is (-1)^n He_n times it. What is left
  // out is below (8 h)^7 / 7! = 1e-10 of the value, h = 1/64.
  const double h = x - at.x;
  const double a = at.x;
  const double a2 = a * a;
  const double he3 = a * (a2 - 3.0);
  const double he4 = a2 * (a2 - 6.0) + 3.0;
  const double he5 = a * (a2 * (a2 - 10.0) + 15.0);
  // In pairs (Estrin), which do not wait for each other.
  const double h2 = h * h;
  const double low = 1.0 - h * a * (1.0 / 2.0);
  const double middle = (a2 - 1.0) * (1.0 / 6.0) - h * he3 * (1.0 / 24.0);
  const double high = he4 * (1.0 / 120.0) - h * he5 * (1.0 / 720.0);
  const double series = h * (low + h2 * (middle + h2 * high));
  return at.cdf + at.density * series;
}

}  // namespace fathom::map
