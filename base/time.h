// The one time type of the project, and its text form.
//
// Time is UTC on POSIX's scale (every day has 86 400 s; a leap second is not
// representable), a whole number of microseconds since 1970-01-01T00:00:00Z.
// Microseconds are what one int64 holds for 292 000 years and finer than any
// sonar's clock. Text is RFC 3339 (section 5.6), years 0000 to 9999.
//
// Functions here read no clock (base/clock.h does) and are thread-safe.

#ifndef FATHOM_BASE_TIME_H_
#define FATHOM_BASE_TIME_H_

#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"

namespace fathom {

// A moment, UTC, microsecond resolution.
using Time = std::chrono::sys_time<std::chrono::microseconds>;

// A signed span between two moments.
using Duration = std::chrono::microseconds;

// The moment `micros` microseconds after 1970-01-01T00:00:00Z; any int64.
constexpr Time TimeFromUnixMicros(std::int64_t micros) {
  return Time(Duration(micros));
}

// Microseconds since 1970-01-01T00:00:00Z; negative before it.
constexpr std::int64_t ToUnixMicros(Time time) {
  return time.time_since_epoch().count();
}

// The span in seconds as a double, for formulas (`age_s`). Exact to a
// microsecond for spans below 285 years (2^53 us).
constexpr double ToSeconds(Duration span) {
  return std::chrono::duration<double>(span).count();
}

// The first and the last moment that text can say, years 0 and 9999. Spans
// between such are far from overflow; times from a file are held to them.
inline constexpr Time kFirstTime =
    std::chrono::sys_days(std::chrono::year(0) / std::chrono::January / 1);
inline constexpr Time kLastTime =
    std::chrono::sys_days(std::chrono::year(10000) / std::chrono::January / 1) -
    Duration(1);

// Writes `time` as RFC 3339 in UTC: "2002-05-24T16:05:09Z", with three or six
// fraction digits only where they are needed ("...09.250Z",
// "...09.000001Z"). REQUIRES: kFirstTime <= time <= kLastTime; other times
// are clamped to them.
std::string FormatTime(Time time);

// Reads an RFC 3339 date-time: "2002-05-24T12:05:09.25-04:00". The `T` and
// `Z` may be lower case; the `T` may be a space; an offset is required. Up to
// nine fraction digits are accepted; those beyond the sixth are cut off.
//
// Errors: INVALID_ARGUMENT, naming the text and what is wrong, for anything
// else, including second 60 (POSIX time has no such moment) and a date that
// the calendar lacks.
absl::StatusOr<Time> ParseTime(std::string_view text);

}  // namespace fathom

#endif  // FATHOM_BASE_TIME_H_
