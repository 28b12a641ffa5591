// Numbers of a scenario and the ranges that they must be in.

#ifndef FATHOM_SIM_FEEDER_NAMED_RANGE_H_
#define FATHOM_SIM_FEEDER_NAMED_RANGE_H_

#include <initializer_list>

#include "absl/status/status.h"
#include "absl/strings/str_format.h"

namespace fathom::feeder {

struct NamedRange {
  const char* name;
  double value;
  // Both allowed.
  double low;
  double high;
};

// Errors: INVALID_ARGUMENT for the first that is outside its range or NaN.
inline absl::Status CheckRanges(std::initializer_list<NamedRange> ranges) {
  for (const NamedRange& range : ranges) {
    if (!(range.value >= range.low && range.value <= range.high)) {
      return absl::InvalidArgumentError(
          absl::StrFormat("%s=%g must be in [%g, %g]", range.name, range.value,
                          range.low, range.high));
    }
  }
  return absl::OkStatus();
}

}  // namespace fathom::feeder

#endif  // FATHOM_SIM_FEEDER_NAMED_RANGE_H_
