// Work on a mission file that no server holds: done by fathomd, which knows
// the format; this program knows the protocol alone (docs/adr/0008).

#ifndef FATHOM_CLIENT_CLI_MISSION_FILE_H_
#define FATHOM_CLIENT_CLI_MISSION_FILE_H_

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "client/cli/session.h"

namespace fathom::client::cli {

// Becomes `fathomd mission ARGUMENTS...`, whose output and exit code are then
// this program's. The program is $FATHOMD, else the one beside this one, else
// the one in PATH. Returns only if it cannot be started: NOT_FOUND, marked as
// the file's.
absl::Status WorkOnMissionFile(const Session& session,
                               std::vector<std::string> arguments);

}  // namespace fathom::client::cli

#endif  // FATHOM_CLIENT_CLI_MISSION_FILE_H_
