// From values to places on a colour bar, with round numbers at its ticks.
// Thread-safe.

#ifndef FATHOM_CLIENT_CLI_VALUE_SCALE_H_
#define FATHOM_CLIENT_CLI_VALUE_SCALE_H_

#include <string>
#include <vector>

namespace fathom::client::cli {

// The largest of 1, 2, 5 times a power of ten that is at most `value` > 0.
double RoundStep(double value);

// The multiples of `step` > 0 in [low, high], rising.
std::vector<double> Multiples(double step, double low, double high);

class ValueScale {
 public:
  enum class Kind {
    kLinear,
    // Equal factors are equally long; low > 0.
    kLogarithmic,
    // By the square root of the height above low: shallow water, which matters
    // most, gets the most room.
    kRoot,
  };

  // Linear over the values between the given quantiles (NaN is skipped),
  // widened to round numbers; or of kind `wide` where they span too much for
  // that: a factor of 30 for kLogarithmic; for kRoot 200 and more with a tenth
  // of the values in the lowest thirtieth.
  static ValueScale Covering(const std::vector<float>& values,
                             double low_quantile, double high_quantile,
                             Kind wide);
  ValueScale(double low, double high, Kind kind);

  // 0 at low, 1 at high; outside them beyond.
  double Place(double value) const;
  double low() const { return low_; }
  double high() const { return high_; }

  Kind kind() const { return kind_; }

  // Round values from low to high, at most about `most`.
  std::vector<double> Ticks(int most) const;
  // "20", "0.5", "1 000".
  static std::string TickText(double value);

 private:
  double low_;
  double high_;
  Kind kind_;
};

}  // namespace fathom::client::cli

#endif  // FATHOM_CLIENT_CLI_VALUE_SCALE_H_
