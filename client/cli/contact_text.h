// Contacts for people, one a line. Thread-safe.

#ifndef FATHOM_CLIENT_CLI_CONTACT_TEXT_H_
#define FATHOM_CLIENT_CLI_CONTACT_TEXT_H_

#include <string>

#include "fathom/v1/types.pb.h"

namespace fathom::client::cli {

inline constexpr char kContactColumns[] =
    "contact                  class        status   position                 "
    "  +- m  m/s  course  reports  time\n";

// A line under these columns.
std::string ContactRow(const v1::ContactEstimate& c);

}  // namespace fathom::client::cli

#endif  // FATHOM_CLIENT_CLI_CONTACT_TEXT_H_
