#include "base/log.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "tests/testing/status_matchers.h"

namespace fathom {
namespace {

using ::fathom::testing::IsOkAndHolds;
using ::fathom::testing::StatusIs;
using ::testing::HasSubstr;
using ::testing::MatchesRegex;

// Runs `write` with standard error captured; returns what was written.
template <typename F>
std::string Captured(F write) {
  ::testing::internal::CaptureStderr();
  write();
  return ::testing::internal::GetCapturedStderr();
}

TEST(Log, WritesOneUtcLineWithLevelAndProgram) {
  InitLog("fathomd", LogLevel::kInfo);
  EXPECT_THAT(
      Captured([] { Log(LogLevel::kInfo, "opened path=%s n=%d", "m", 3); }),
      MatchesRegex("[0-9]{4}-[0-9]{2}-[0-9]{2}T[0-9]{2}:[0-9]{2}:"
                   "[0-9]{2}[.][0-9]{3}Z I fathomd: opened path=m n=3\n"));
}

TEST(Log, DropsWhatIsBelowTheLevel) {
  InitLog("fathomd", LogLevel::kWarning);
  EXPECT_FALSE(LogEnabled(LogLevel::kInfo));
  EXPECT_TRUE(LogEnabled(LogLevel::kError));
  EXPECT_EQ(Captured([] { Log(LogLevel::kInfo, "quiet"); }), "");
  EXPECT_THAT(Captured([] { Log(LogLevel::kWarning, "loud"); }),
              HasSubstr(" W fathomd: loud\n"));
}

TEST(Log, ALineFeedCannotForgeALine) {
  InitLog("fathomd", LogLevel::kInfo);
  EXPECT_THAT(Captured([] { LogLine(LogLevel::kError, "a\nb\r{}c"); }),
              HasSubstr("E fathomd: a b {}c\n"));
}

TEST(ParseLogLevel, KnowsFourNamesAndListsThemInItsError) {
  EXPECT_THAT(ParseLogLevel("debug"), IsOkAndHolds(LogLevel::kDebug));
  EXPECT_THAT(ParseLogLevel("info"), IsOkAndHolds(LogLevel::kInfo));
  EXPECT_THAT(ParseLogLevel("warning"), IsOkAndHolds(LogLevel::kWarning));
  EXPECT_THAT(ParseLogLevel("error"), IsOkAndHolds(LogLevel::kError));
  EXPECT_THAT(ParseLogLevel("INFO"),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("debug, info, warning, error")));
}

}  // namespace
}  // namespace fathom
