// One ping of a forward-looking sonar, and why parts of one are refused.
//
// The inputs of the static obstacle map (Nervegna 2002, section 4.2,
// figs. 4-1 and 4-2): the vehicle's pose and, per measurement, range,
// bearing, mean and standard deviation of the depth.

#ifndef FATHOM_MAP_GEODESY_PING_H_
#define FATHOM_MAP_GEODESY_PING_H_

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "base/time.h"
#include "map/geodesy/ids.h"
#include "map/geodesy/pose.h"

namespace fathom::map {

// One measurement of a ping: already grouped by the sonar's cell (thesis
// section 3.5.2), so it is a mean depth over a small patch.
struct Beam {
  // Horizontal distance from the vehicle, thesis r.
  float range_m = 0.0f;
  // Clockwise from the bow, thesis beta.
  float bearing_rad = 0.0f;
  // Mean depth, below the mission's vertical datum, thesis mu_depth.
  float depth_m = 0.0f;
  // 1-sigma of that mean, thesis sigma_depth.
  float std_m = 0.0f;

  friend bool operator==(const Beam&, const Beam&) = default;
};

// All beams of one ping and where the vehicle was.
struct Ping {
  ActivityId activity;
  Time time;
  Pose pose;
  std::vector<Beam> beams;

  friend bool operator==(const Ping&, const Ping&) = default;
};

// Why a measurement or a report was refused. The numbers are those of
// fathom.v1.RejectReason and are stored: never reuse one.
enum class RejectReason : std::uint8_t {
  kNotFinite = 1,      // A number was NaN or infinite.
  kBelowMinRange = 2,  // range <= R_min (thesis 4.3.3.1).
  kAboveMaxRange = 3,  // range >= R_max (thesis 4.3.3.1).
  kBadStd = 4,         // std <= 0 or beyond its limit.
  kOutsideArea = 5,    // The place lies outside the activity's area.
  kBadDepth = 6,       // Depth outside [-100, 12000] m.
  kInvalidMessage = 7,
  kNoActivity = 8,     // The named activity is not open.
  kGated = 9,          // A gate refused it: the innovation of a contact's
                       // report, the gross shoal of a sounding.
  kTooLate = 10,       // Older than late reports are accepted (contacts).
  kContactsFull = 11,  // The contact list is full.
  kBadLink = 12,       // Contacts cannot be linked as the report says.
};

// One past the greatest RejectReason.
inline constexpr std::size_t kRejectReasonEnd = 13;

// The name of the reason as in the protocol, e.g. "BELOW_MIN_RANGE"; "?" for
// a number that is none.
std::string_view RejectReasonName(RejectReason reason);

// How many were refused, by reason. Plain value.
class RejectCounts {
 public:
  // REQUIRES: `reason` is one of the enumerators.
  void Add(RejectReason reason, std::uint64_t n = 1) {
    counts_[static_cast<std::size_t>(reason)] += n;
  }
  void Merge(const RejectCounts& other) {
    for (std::size_t i = 0; i < kRejectReasonEnd; ++i) {
      counts_[i] += other.counts_[i];
    }
  }
  std::uint64_t count(RejectReason reason) const {
    return counts_[static_cast<std::size_t>(reason)];
  }
  std::uint64_t total() const {
    std::uint64_t sum = 0;
    for (const std::uint64_t count : counts_) sum += count;
    return sum;
  }
  bool empty() const { return total() == 0; }

  friend bool operator==(const RejectCounts&, const RejectCounts&) = default;

 private:
  std::array<std::uint64_t, kRejectReasonEnd> counts_ = {};
};

}  // namespace fathom::map

#endif  // FATHOM_MAP_GEODESY_PING_H_
