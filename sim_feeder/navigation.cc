#include "sim_feeder/navigation.h"

#include <algorithm>
#include <cmath>

#include "sim_feeder/named_range.h"

namespace fathom::feeder {

absl::Status ValidateNavigation(const NavigationOptions& options) {
  return CheckRanges({{"bias_north_m", options.bias_north_m, -1000, 1000},
                      {"bias_east_m", options.bias_east_m, -1000, 1000},
                      {"walk_m_per_sqrt_s", options.walk_m_per_sqrt_s, 0, 100},
                      {"fix_interval_s", options.fix_interval_s, 0, 1e6},
                      {"fix_std_m", options.fix_std_m, 0, 1000}});
}

Navigation::Navigation(const NavigationOptions& options, std::uint64_t seed)
    : options_(options), random_(seed, RandomStream::kNavigation) {
  Fix();
}

void Navigation::Fix() {
  drift_ = {.north_m = random_.Normal(0.0, options_.fix_std_m),
            .east_m = random_.Normal(0.0, options_.fix_std_m)};
  fixed_s_ = now_s_;
}

void Navigation::Advance(double seconds) {
  const auto walk_to = [&](double until_s) {
    const double std_m =
        options_.walk_m_per_sqrt_s * std::sqrt(std::max(0.0, until_s - now_s_));
    drift_.north_m += random_.Normal(0.0, std_m);
    drift_.east_m += random_.Normal(0.0, std_m);
    now_s_ = std::max(now_s_, until_s);
  };
  while (options_.fix_interval_s > 0.0 &&
         fixed_s_ + options_.fix_interval_s <= seconds) {
    walk_to(fixed_s_ + options_.fix_interval_s);
    Fix();
  }
  if (seconds > now_s_) walk_to(seconds);
}

double Navigation::stated_std_m() const {
  return std::hypot(options_.fix_std_m,
                    options_.walk_m_per_sqrt_s * std::sqrt(now_s_ - fixed_s_));
}

}  // namespace fathom::feeder
