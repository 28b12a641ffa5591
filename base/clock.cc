#include "base/clock.h"

namespace fathom {

Time SystemClock::Now() const {
  return std::chrono::time_point_cast<Duration>(
      std::chrono::system_clock::now());
}

}  // namespace fathom
