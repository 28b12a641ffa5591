// From values to places on a colour bar, with round numbers at its ticks.
// Thread-safe.

#ifndef FATHOM_CLIENT_CLI_VALUE_SCALE_H_
#define FATHOM_CLIENT_CLI_VALUE_SCALE_H_

#include <string>
#include <vector>

namespace fathom::client::cli {

// The largest of 1, 2, 5 times a power of ten that is at most `value` > 0.
double RoundStep(double value);

class ValueScale {
 public:
  // Spans the values between the given quantiles (NaN is skipped), widened to
  // round numbers. Logarithmic if `allow_logarithmic`, all values are > 0 and
  // they span more than a factor of 30.
  static ValueScale Covering(const std::vector<float>& values,
                             double low_quantile, double high_quantile,
                             bool allow_logarithmic);
  ValueScale(double low, double high, bool logarithmic);

  // 0 at low, 1 at high; outside them beyond.
  double Place(double value) const;
  double low() const { return low_; }
  double high() const { return high_; }

  // Round values from low to high, at most about `most`.
  std::vector<double> Ticks(int most) const;
  // "20", "0.5", "1 000".
  static std::string TickText(double value);

 private:
  double low_;
  double high_;
  bool logarithmic_;
};

}  // namespace fathom::client::cli

#endif  // FATHOM_CLIENT_CLI_VALUE_SCALE_H_
