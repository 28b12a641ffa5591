#include "client/cli/completion.h"

#include <vector>

#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"

namespace fathom::client::cli {
namespace {

// What the script's three `case`s hold.
struct Cases {
  // "fathom activity", "fathom activity start", ...: the ways to a verb.
  std::vector<std::string> ways;
  // For each way, fathom's own too: the verbs and flags there.
  std::string offers;
  // For each flag that takes a value: the words it may be.
  std::string values;
};

std::vector<std::string> FlagsOf(const CLI::Option& option) {
  std::vector<std::string> flags;
  for (const std::string& name : option.get_lnames()) {
    flags.push_back("--" + name);
  }
  for (const std::string& name : option.get_snames()) {
    flags.push_back("-" + name);
  }
  return flags;
}

// "adaptive kalman" from CLI::IsMember's "TEXT:{adaptive,kalman}"; else "".
std::string WordsOf(const CLI::Option& option) {
  const std::string type = option.get_type_name();
  const std::size_t open = type.find('{');
  const std::size_t close = type.find('}');
  if (open == std::string::npos || close == std::string::npos) return "";
  return absl::StrReplaceAll(type.substr(open + 1, close - open - 1),
                             {{",", " "}});
}

void Collect(const CLI::App& app, const std::string& way,
             std::vector<std::string> flags, Cases& cases) {
  for (const CLI::Option* option : app.get_options({})) {
    const std::vector<std::string> own = FlagsOf(*option);
    flags.insert(flags.end(), own.begin(), own.end());
    if (option->get_items_expected_max() == 0 || own.empty()) continue;
    std::vector<std::string> patterns;
    for (const std::string& flag : own) {
      patterns.push_back(absl::StrFormat("'%s'*' %s'", way, flag));
    }
    absl::StrAppendFormat(&cases.values, "    %s) values='%s' ;;\n",
                          absl::StrJoin(patterns, " | "), WordsOf(*option));
  }
  std::vector<std::string> verbs;
  for (const CLI::App* verb : app.get_subcommands({})) {
    verbs.push_back(verb->get_name());
    const std::string there = way + " " + verb->get_name();
    cases.ways.push_back("'" + there + "'");
    Collect(*verb, there, flags, cases);
  }
  absl::StrAppendFormat(
      &cases.offers, "    '%s')\n      verbs='%s'\n      flags='%s' ;;\n", way,
      absl::StrJoin(verbs, " "), absl::StrJoin(flags, " "));
}

constexpr char kScript[] =
    R"(# bash completion for fathom; made by `fathom completion`.
_fathom() {
  local cur=${COMP_WORDS[COMP_CWORD]} prev=${COMP_WORDS[COMP_CWORD - 1]}
  local way=fathom verbs= flags= values i
  for ((i = 1; i < COMP_CWORD; i++)); do
    case "$way ${COMP_WORDS[i]}" in
      %s) way+=" ${COMP_WORDS[i]}" ;;
    esac
  done
  COMPREPLY=()
  # Behind a flag that takes a value, only that: its words or a file.
  case "$way $prev" in
%s    *) values=none ;;
  esac
  if [[ $values != none ]]; then
    COMPREPLY=($(compgen -W "$values" -- "$cur"))
    return
  fi
  case "$way" in
%s  esac
  if [[ $cur == -* ]]; then
    COMPREPLY=($(compgen -W "$flags" -- "$cur"))
  else
    COMPREPLY=($(compgen -W "$verbs" -- "$cur"))
  fi
}
complete -o default -F _fathom fathom
)";

}  // namespace

std::string BashCompletion(const CLI::App& app) {
  Cases cases;
  Collect(app, app.get_name(), {}, cases);
  return absl::StrFormat(kScript, absl::StrJoin(cases.ways, " | "),
                         cases.values, cases.offers);
}

}  // namespace fathom::client::cli
