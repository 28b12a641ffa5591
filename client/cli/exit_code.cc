#include "client/cli/exit_code.h"

#include "absl/strings/cord.h"
#include "absl/types/optional.h"

namespace fathom::client::cli {
namespace {

constexpr char kMarkUrl[] = "fathom.cli/exit-code";
constexpr char kUsageMark[] = "usage";
constexpr char kFileMark[] = "file";

absl::Status Mark(absl::Status status, const char* mark) {
  if (!status.ok() && !status.GetPayload(kMarkUrl).has_value()) {
    status.SetPayload(kMarkUrl, absl::Cord(mark));
  }
  return status;
}

}  // namespace

absl::Status UsageError(absl::Status status) {
  return Mark(std::move(status), kUsageMark);
}

absl::Status FileError(absl::Status status) {
  return Mark(std::move(status), kFileMark);
}

ExitCode ExitCodeOf(const absl::Status& status) {
  if (status.ok()) return ExitCode::kOk;
  const absl::optional<absl::Cord> mark = status.GetPayload(kMarkUrl);
  if (mark.has_value()) {
    return *mark == kUsageMark ? ExitCode::kUsage : ExitCode::kBadFile;
  }
  switch (status.code()) {
    case absl::StatusCode::kUnavailable:
    case absl::StatusCode::kDeadlineExceeded:
      return ExitCode::kUnreachable;
    default:
      return ExitCode::kRefused;
  }
}

}  // namespace fathom::client::cli
