#include "base/time.h"

#include <algorithm>
#include <optional>

#include "absl/status/status.h"
#include "absl/strings/str_format.h"

namespace fathom {
namespace {

using std::chrono::days;
using std::chrono::hours;
using std::chrono::microseconds;
using std::chrono::minutes;
using std::chrono::seconds;
using std::chrono::sys_days;
using std::chrono::year_month_day;

// Digits past the sixth would be below our resolution; nine (nanoseconds) is
// what other programs write.
constexpr int kMaxFractionDigits = 9;

// Consumes text from its front; every Take* reports whether it matched.
class Reader {
 public:
  explicit Reader(std::string_view text) : rest_(text) {}

  // Exactly `digits` decimal digits.
  std::optional<int> TakeNumber(int digits) {
    int value = 0;
    for (int i = 0; i < digits; ++i) {
      const std::optional<int> digit = TakeDigit();
      if (!digit.has_value()) return std::nullopt;
      value = value * 10 + *digit;
    }
    return value;
  }

  // One digit, or nothing consumed.
  std::optional<int> TakeDigit() {
    if (rest_.empty() || rest_.front() < '0' || rest_.front() > '9') {
      return std::nullopt;
    }
    const int digit = rest_.front() - '0';
    rest_.remove_prefix(1);
    return digit;
  }

  // The character that matched one of `choices`, consumed.
  std::optional<char> TakeAnyOf(std::string_view choices) {
    if (rest_.empty() || choices.find(rest_.front()) == choices.npos) {
      return std::nullopt;
    }
    const char taken = rest_.front();
    rest_.remove_prefix(1);
    return taken;
  }

  bool empty() const { return rest_.empty(); }

 private:
  std::string_view rest_;
};

absl::Status Malformed(std::string_view text, std::string_view problem) {
  return absl::InvalidArgumentError(
      absl::StrFormat("time=\"%s\" is not RFC 3339 (%s); write it like "
                      "2002-05-24T16:05:09.25Z",
                      std::string(text), std::string(problem)));
}

// "yyyy-mm-dd"; nullopt for a malformed or non-existent date.
std::optional<sys_days> TakeDate(Reader& reader) {
  const auto year = reader.TakeNumber(4);
  if (!year || !reader.TakeAnyOf("-")) return std::nullopt;
  const auto month = reader.TakeNumber(2);
  if (!month || !reader.TakeAnyOf("-")) return std::nullopt;
  const auto day = reader.TakeNumber(2);
  if (!day) return std::nullopt;
  const year_month_day date(std::chrono::year(*year),
                            std::chrono::month(static_cast<unsigned>(*month)),
                            std::chrono::day(static_cast<unsigned>(*day)));
  if (!date.ok()) return std::nullopt;
  return sys_days(date);
}

// "hh:mm:ss[.f]"; nullopt where malformed or out of range.
std::optional<Duration> TakeTimeOfDay(Reader& reader) {
  const auto hour = reader.TakeNumber(2);
  if (!hour || *hour > 23 || !reader.TakeAnyOf(":")) return std::nullopt;
  const auto minute = reader.TakeNumber(2);
  if (!minute || *minute > 59 || !reader.TakeAnyOf(":")) return std::nullopt;
  const auto second = reader.TakeNumber(2);
  if (!second || *second > 59) return std::nullopt;
  Duration result = hours(*hour) + minutes(*minute) + seconds(*second);
  if (!reader.TakeAnyOf(".")) return result;
  std::int64_t unit_us = 100'000;  // Weight of the next digit.
  int digits = 0;
  while (const auto digit = reader.TakeDigit()) {
    result += microseconds(*digit * unit_us);
    unit_us /= 10;
    if (++digits > kMaxFractionDigits) return std::nullopt;
  }
  if (digits == 0) return std::nullopt;
  return result;
}

// "Z" or "+hh:mm" or "-hh:mm"; nullopt where malformed.
std::optional<Duration> TakeOffset(Reader& reader) {
  const auto sign = reader.TakeAnyOf("Zz+-");
  if (!sign) return std::nullopt;
  if (*sign == 'Z' || *sign == 'z') return Duration(0);
  const auto hour = reader.TakeNumber(2);
  if (!hour || *hour > 23 || !reader.TakeAnyOf(":")) return std::nullopt;
  const auto minute = reader.TakeNumber(2);
  if (!minute || *minute > 59) return std::nullopt;
  const Duration offset = hours(*hour) + minutes(*minute);
  return *sign == '-' ? -offset : offset;
}

}  // namespace

std::string FormatTime(Time time) {
  time = std::clamp(time, kFirstTime, kLastTime);
  const sys_days day = std::chrono::floor<days>(time);
  const year_month_day date(day);
  const std::chrono::hh_mm_ss<microseconds> clock(time - day);
  std::string text = absl::StrFormat(
      "%04d-%02d-%02dT%02d:%02d:%02d", static_cast<int>(date.year()),
      static_cast<unsigned>(date.month()), static_cast<unsigned>(date.day()),
      clock.hours().count(), clock.minutes().count(), clock.seconds().count());
  const std::int64_t fraction_us = clock.subseconds().count();
  if (fraction_us % 1000 != 0) {
    absl::StrAppendFormat(&text, ".%06d", fraction_us);
  } else if (fraction_us != 0) {
    absl::StrAppendFormat(&text, ".%03d", fraction_us / 1000);
  }
  text += 'Z';
  return text;
}

absl::StatusOr<Time> ParseTime(std::string_view text) {
  Reader reader(text);
  const auto date = TakeDate(reader);
  if (!date) return Malformed(text, "no such date");
  if (!reader.TakeAnyOf("Tt ")) return Malformed(text, "no T after the date");
  const auto time_of_day = TakeTimeOfDay(reader);
  if (!time_of_day) return Malformed(text, "no such time of day");
  const auto offset = TakeOffset(reader);
  if (!offset) return Malformed(text, "no offset: Z or +hh:mm");
  if (!reader.empty()) return Malformed(text, "more text behind the offset");
  return Time(*date) + *time_of_day - *offset;
}

}  // namespace fathom
