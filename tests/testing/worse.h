// Which of two errors is worse: std::max(x, NaN) is x, and a NaN must fail.

#ifndef FATHOM_TESTS_TESTING_WORSE_H_
#define FATHOM_TESTS_TESTING_WORSE_H_

#include <cmath>

namespace fathom::testing {

// NaN is worse than every number.
inline bool IsWorse(double error, double than) {
  return std::isnan(error) ? !std::isnan(than) : error > than;
}

inline double WorseOf(double a, double b) { return IsWorse(b, a) ? b : a; }

}  // namespace fathom::testing

#endif  // FATHOM_TESTS_TESTING_WORSE_H_
