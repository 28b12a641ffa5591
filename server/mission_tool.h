// `fathomd mission VERB FILE`: what can be done with a mission file that no
// server holds. It is here, not in the client, because the client knows the
// protocol alone (docs/adr/0008); `fathom mission VERB --file FILE` starts it.

#ifndef FATHOM_SERVER_MISSION_TOOL_H_
#define FATHOM_SERVER_MISSION_TOOL_H_

namespace fathom::server {

// `argv[0]` is "mission". Prints the result on standard output (--json: as one
// document) and an error on standard error. Returns the exit code: 0 done and
// sound, 1 refused or failed, 2 misuse, 4 the mission is damaged.
int MissionToolMain(int argc, char** argv);

}  // namespace fathom::server

#endif  // FATHOM_SERVER_MISSION_TOOL_H_
