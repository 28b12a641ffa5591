// An obstacle's reasons for people. Thread-safe.

#ifndef FATHOM_CLIENT_CLI_ANSWER_TEXT_H_
#define FATHOM_CLIENT_CLI_ANSWER_TEXT_H_

#include <string>

#include "fathom/v1/obstacle_service.pb.h"

namespace fathom::client::cli {

// One line for the seabed and one for each contact, each indented by two.
std::string ReasonsText(const v1::ObstacleAnswer& answer);

// "  map       revision 12, as of 2026-01-01T12:00:00Z\n".
std::string StampText(const v1::MapStamp& stamp);

}  // namespace fathom::client::cli

#endif  // FATHOM_CLIENT_CLI_ANSWER_TEXT_H_
