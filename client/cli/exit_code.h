// How the `fathom` command ends. Scripts depend on these numbers; --help
// states them.

#ifndef FATHOM_CLIENT_CLI_EXIT_CODE_H_
#define FATHOM_CLIENT_CLI_EXIT_CODE_H_

#include "absl/status/status.h"

namespace fathom::client::cli {

enum class ExitCode : int {
  kOk = 0,
  // The command line is wrong; nothing was sent.
  kUsage = 1,
  // The server was asked and said no.
  kRefused = 2,
  // No server answered.
  kUnreachable = 3,
  // A file given is missing, damaged or not usable.
  kBadFile = 4,
  // `fathom check`: the trajectory meets an obstacle, or what counts as one.
  kConflict = 5,
  // `fathom check`: it meets none, but is not FREE throughout.
  kUncertain = 6,
};

// Marks an error so that the command ends with kUsage or kBadFile. The code
// and message stay.
absl::Status UsageError(absl::Status status);
absl::Status FileError(absl::Status status);

// kOk for OK; the mark, if there is one; else kUnreachable for UNAVAILABLE
// and DEADLINE_EXCEEDED, kRefused for the rest.
ExitCode ExitCodeOf(const absl::Status& status);

}  // namespace fathom::client::cli

#endif  // FATHOM_CLIENT_CLI_EXIT_CODE_H_
