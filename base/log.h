// The set-up of our programs' log: one line an event on standard error, in
// UTC, as
//
//   2002-05-24T16:05:09.250Z I fathomd: mission opened path="m.fathom"
//
// Libraries do not log: they return a status and the program decides. A
// program calls InitLog once at start and then the functions below. Backed by
// spdlog, which this header does not show. Thread-safe after InitLog.

#ifndef FATHOM_BASE_LOG_H_
#define FATHOM_BASE_LOG_H_

#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "absl/strings/str_format.h"

namespace fathom {

// In order of weight. A message below the level set in InitLog is dropped.
enum class LogLevel {
  kDebug,    // For whoever hunts a fault; may be one line a message.
  kInfo,     // What an operator wants in the mission's record.
  kWarning,  // Work goes on, but someone should look.
  kError,    // Something asked for was not done.
};

// Reads the value of a --log-level flag: debug, info, warning, error.
// Errors: INVALID_ARGUMENT, listing the names.
absl::StatusOr<LogLevel> ParseLogLevel(std::string_view name);

// Directs the log of `program` to standard error from `level` on. Before the
// first call the level is info and the name is empty. Call it before threads
// start.
void InitLog(std::string_view program, LogLevel level);

// Whether a message of this level would be written; lets a caller skip the
// work of composing it.
bool LogEnabled(LogLevel level);

// Writes one line. A line feed in `message` is written as a space, so that a
// hostile string from a client cannot forge a line. Flushed from kWarning on.
void LogLine(LogLevel level, std::string_view message);

// Formats as absl::StrFormat and writes one line:
//   Log(LogLevel::kInfo, "listening address=%s", address);
template <typename... Args>
void Log(LogLevel level, const absl::FormatSpec<Args...>& format,
         const Args&... args) {
  if (LogEnabled(level)) LogLine(level, absl::StrFormat(format, args...));
}

}  // namespace fathom

#endif  // FATHOM_BASE_LOG_H_
