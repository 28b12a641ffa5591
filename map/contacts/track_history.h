// The estimates of one contact that are in memory: the newest all, those
// before thinned, so that the past of hours is smoothed as that of minutes is.
//
// What is kept are estimates as they were made, not smoothed ones: to smooth
// over fewer of them is the same recursion with longer steps (contact.h), whose
// answer is no surer than what it rests on. Between x at t_i and the later x_j
// it is the bridge of the motion's white acceleration over both, and
// x_i given x_j comes of all reports up to t_i and, through the estimate at
// t_j, of those between, except for what they say of x_i beyond x_j. That is
// little while the motion between is sure: with density q, a step T and
// the least variance v of the place in any direction, while
//   q T^3 <= kSkippedShare v.
// Of a steady track the smoothed standard deviation grows by 2.5 % at most
// (docs/adr/0015; tests/map/contacts/older_past_test.cc).
//
// Logs are copied as shared_log.h says.

#ifndef FATHOM_MAP_CONTACTS_TRACK_HISTORY_H_
#define FATHOM_MAP_CONTACTS_TRACK_HISTORY_H_

#include <bitset>
#include <cstddef>
#include <optional>

#include "base/time.h"
#include "map/contacts/contact_class.h"
#include "map/contacts/contact_point.h"
#include "map/contacts/shared_log.h"

namespace fathom::map {

// Estimates kept per contact as they came.
inline constexpr std::size_t kRecentEstimates = 256;

// Of those before, so many: 33 kB, half of what the newest take. Radar at
// 1.5 s and 20 m fills them in 25 minutes, reports each minute in two hours;
// then resolution falls with age.
inline constexpr std::size_t kOlderEstimates = 128;

// So many of them are let go at once when all places are taken, which takes as
// long as to look at all of them.
inline constexpr std::size_t kLetGo = 32;

// See file comment.
inline constexpr double kSkippedShare = 0.1;

// Whether smoothing may step from `from` to `to`, a later estimate of the same
// life, over what lies between.
bool MaySkip(const ContactPoint& from, const ContactPoint& to,
             const ContactClassTable& classes);

// Estimates in order of time.
template <std::size_t kMost>
class EstimateLog : public SharedLog<ContactPoint, kMost> {
 public:
  // Index of the newest point with time <= t; nullopt if all are later. Of
  // several at t the last. O(log size).
  std::optional<std::size_t> NewestAtOrBefore(Time t) const;
};

// The newest estimates of one contact, oldest first.
using TrackHistory = EstimateLog<kRecentEstimates>;

// Estimates of before, thinned. A function of the estimates in their order
// alone.
//
// Which are needed is found when the next one comes, while they are at hand: to
// look at what leaves the newest costs a cache miss a report.
class OlderEstimates : public EstimateLog<kOlderEstimates> {
 public:
  // To be called before `next` is appended to `history`: takes what leaves
  // `history`, if it is needed:
  // - the first and the last of a life and the marker of a drop always, so that
  //   the contact is absent where it was absent;
  // - one that says another class, status, radius or, beyond its 1 sigma,
  //   depth than the needed one before;
  // - one that may not be skipped on the way to the estimate after it.
  // When all places are taken kLetGo go whose neighbours are nearest together
  // for their age, never two side by side nor those of the first two kinds
  // (but for the depth: what stays before then says the depths of both). Are
  // there too few, the oldest go.
  void Next(const TrackHistory& history, const ContactPoint& next,
            const ContactClassTable& classes);
  // To be called when only the oldest `size` of the newest are kept.
  void Truncate(std::size_t size);

 private:
  void LetGo();

  // Of the newest estimates, by index: needed once they leave. Never the last.
  std::bitset<kRecentEstimates> needed_;
  // 1 + the last index of which needed_ says so; 0: none.
  std::size_t last_needed_ = 0;
};

}  // namespace fathom::map

#endif  // FATHOM_MAP_CONTACTS_TRACK_HISTORY_H_
