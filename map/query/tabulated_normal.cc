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

// Taylor's series of the distribution function about -kReach, ..., kReach.
class Table {
 public:
  // Of one place: the function is the sum of c[n] t^n, t in steps from there.
  // A line of the cache each.
  struct alignas(64) Series {
    std::array<double, 7> c;
  };

  Table() {
    for (std::size_t k = 0; k < series_.size(); ++k) {
      const double a = static_cast<double>(k) / kPlacesPerUnit - kReach;
      const double density = std::exp(-0.5 * a * a) * 0.5 *
                             std::numbers::inv_sqrtpi * std::numbers::sqrt2;
      // The n-th derivative of the density is (-1)^n He_n times it.
      std::array<double, 6> hermite = {1.0, a};
      for (std::size_t n = 2; n < hermite.size(); ++n) {
        hermite[n] =
            a * hermite[n - 1] - static_cast<double>(n - 1) * hermite[n - 2];
      }
      series_[k].c[0] = NormalCdf(a);
      double scale = density;
      for (std::size_t n = 0; n < hermite.size(); ++n) {
        scale /= static_cast<double>(n + 1) * kPlacesPerUnit;
        series_[k].c[n + 1] = scale * hermite[n];
        scale = -scale;
      }
    }
  }

  const Series& operator[](int k) const {
    // By way of int: to the unsigned is dearer.
    return series_[static_cast<std::size_t>(k)];
  }

 private:
  static constexpr std::size_t kPlaces =
      static_cast<std::size_t>(2 * kReach * kPlacesPerUnit) + 1;
  std::array<Series, kPlaces> series_;
};

}  // namespace

double TabulatedNormalCdf(double x) {
  // Written so that NaN goes this way.
  if (!(std::fabs(x) < kReach)) return NormalCdf(x);
  static const Table table;
  // The nearest place is the one half a step below or less.
  const double steps = x * kPlacesPerUnit + (kReach * kPlacesPerUnit + 0.5);
  const int k = static_cast<int>(steps);
  const double t = steps - (static_cast<double>(k) + 0.5);
  const auto& c = table[k].c;
  // In pairs (Estrin), which do not wait for each other. What is left out is
  // below (8 h)^7 / 7! = 1e-10 of the value, h = 1/64.
  const double t2 = t * t;
  return (c[0] + t * c[1]) +
         t2 * ((c[2] + t * c[3]) + t2 * ((c[4] + t * c[5]) + t2 * c[6]));
}

}  // namespace fathom::map
