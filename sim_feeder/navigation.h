// Where the vehicle believes it is: dead reckoning that drifts until a fix.
//
// The error is a constant bias, and a random walk per axis that each fix sets
// back to the fix's own error (Nervegna 2002, section 3.4 assumes none). The
// stated uncertainty is that of the walk and the fix; nobody knows the bias.
//
// Deterministic in its seed. Not thread-safe.

#ifndef FATHOM_SIM_FEEDER_NAVIGATION_H_
#define FATHOM_SIM_FEEDER_NAVIGATION_H_

#include <cstdint>

#include "absl/status/status.h"
#include "sim_feeder/random.h"
#include "sim_feeder/track_plan.h"

namespace fathom::feeder {

struct NavigationOptions {
  // Believed minus true place, metres, in [-1000, 1000].
  double bias_north_m = 0.0;
  double bias_east_m = 0.0;
  // 1 sigma of the walk per axis after one second, metres, in [0, 100]; it
  // grows with the root of time.
  double walk_m_per_sqrt_s = 0.0;
  // Between fixes, seconds; 0: none after the first at the start.
  double fix_interval_s = 0.0;
  // 1 sigma of a fix per axis, metres, in [0, 1000].
  double fix_std_m = 0.0;

  bool exact() const {
    return bias_north_m == 0.0 && bias_east_m == 0.0 &&
           walk_m_per_sqrt_s == 0.0 && fix_std_m == 0.0;
  }
};

// Errors: INVALID_ARGUMENT naming the option and its range.
absl::Status ValidateNavigation(const NavigationOptions& options);

class Navigation {
 public:
  // REQUIRES: valid options.
  Navigation(const NavigationOptions& options, std::uint64_t seed);

  // Goes on to `seconds` since the start; not backwards.
  void Advance(double seconds);

  // Believed minus true place, metres.
  PlanePoint error() const {
    return {.north_m = options_.bias_north_m + drift_.north_m,
            .east_m = options_.bias_east_m + drift_.east_m};
  }
  // 1 sigma per axis that the vehicle states, metres.
  double stated_std_m() const;

 private:
  void Fix();

  const NavigationOptions options_;
  Random random_;
  double now_s_ = 0.0;
  double fixed_s_ = 0.0;
  PlanePoint drift_;
};

}  // namespace fathom::feeder

#endif  // FATHOM_SIM_FEEDER_NAVIGATION_H_
