// Completion for bash, made from the command line's own list of verbs and
// flags, so that it cannot lag behind them.

#ifndef FATHOM_CLIENT_CLI_COMPLETION_H_
#define FATHOM_CLIENT_CLI_COMPLETION_H_

#include <CLI/CLI.hpp>
#include <string>

namespace fathom::client::cli {

// A bash script that completes `app`'s verbs, their flags, and the values of
// flags that take one of a few words; elsewhere bash completes file names.
// Flags before the verb are offered behind it too (App::fallthrough).
std::string BashCompletion(const CLI::App& app);

}  // namespace fathom::client::cli

#endif  // FATHOM_CLIENT_CLI_COMPLETION_H_
