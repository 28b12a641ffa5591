// What the load programs measure with.

#ifndef FATHOM_TESTS_BENCH_RPC_MEASURE_H_
#define FATHOM_TESTS_BENCH_RPC_MEASURE_H_

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <iostream>
#include <string>
#include <vector>

#include "absl/status/status.h"

namespace fathom::bench {

using SteadyClock = std::chrono::steady_clock;

inline double SecondsSince(SteadyClock::time_point start) {
  return std::chrono::duration<double>(SteadyClock::now() - start).count();
}

// The value below which a share of the sample lies; 0 of none.
inline double Quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  const auto nth =
      values.begin() + static_cast<std::ptrdiff_t>(
                           share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

inline double Median(const std::vector<double>& values) {
  return Quantile(values, 0.5);
}

// The program's exit code; what failed is told.
inline int ExitCode(const std::string& program, const absl::Status& status) {
  if (status.ok()) return 0;
  std::cerr << program << ": " << status.ToString() << "\n";
  return 1;
}

}  // namespace fathom::bench

#endif  // FATHOM_TESTS_BENCH_RPC_MEASURE_H_
