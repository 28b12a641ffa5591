// A program of crash points: works, cuts the power after every operation of
// the work in every mode, lets a check look at what is left, and tells.

#ifndef FATHOM_TESTS_FAULT_CRASH_RUN_H_
#define FATHOM_TESTS_FAULT_CRASH_RUN_H_

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "absl/functional/function_ref.h"
#include "tests/fault/crash_image.h"

namespace fathom::fault {

// What was done and found so far.
struct CrashTally {
  std::uint64_t wanted_points = 0;
  std::uint64_t points = 0;
  std::uint64_t operations = 0;
  std::uint64_t units = 0;  // CrashTest::unit, as the test counts them.
  std::uint64_t recoveries_cut = 0;
  std::uint64_t bad = 0;
  std::vector<std::string> examples = {};  // The first ten.
};

// Cuts after each of `log`, until the points are enough; sets of files that two
// modes leave alike are looked at once. `check` is given how many operations
// came before the cut and what is left, and says what is wrong with it; empty:
// nothing.
void CutEverywhere(
    CrashImage image, const std::vector<DiskOperation>& log, std::uint64_t seed,
    absl::FunctionRef<std::string(std::size_t, const FileSet&)> check,
    CrashTally& tally);

struct CrashTest {
  std::string what;          // For --help.
  std::string name;          // In the result.
  std::string unit;          // What is counted there beside operations.
  std::string control_flag;  // With it the test must find something bad.
  // Works once and cuts; `control`: the flag was given.
  std::function<void(std::uint64_t seed, bool control, CrashTally& tally)>
      round;
};

// Rounds until --points are checked. The result is a JSON document (--out).
// Exit code: 0 nothing bad, 1 something bad, 2 misuse or a failure of the test
// itself.
int CrashPointsMain(int argc, char** argv, const CrashTest& test);

}  // namespace fathom::fault

#endif  // FATHOM_TESTS_FAULT_CRASH_RUN_H_
