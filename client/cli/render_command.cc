#include "client/cli/session.h"

namespace fathom::client::cli {
void AddRender(CLI::App&, Session&) {}
}  // namespace fathom::client::cli
