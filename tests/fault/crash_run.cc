#include "tests/fault/crash_run.h"

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>
#include <set>
#include <utility>

#include "absl/strings/str_format.h"

namespace fathom::fault {
namespace {

constexpr std::size_t kMaxExamples = 10;

}  // namespace

void CutEverywhere(
    CrashImage image, const std::vector<DiskOperation>& log, std::uint64_t seed,
    absl::FunctionRef<std::string(std::size_t, const FileSet&)> check,
    CrashTally& tally) {
  std::mt19937_64 random(seed + 2);
  for (std::size_t n = 0; n <= log.size(); ++n) {
    if (n > 0) image.Apply(log[n - 1]);
    std::set<FileSet> seen;
    for (int mode = 0; mode < kCrashModes; ++mode) {
      if (tally.points >= tally.wanted_points) break;
      const FileSet files = image.After(static_cast<CrashMode>(mode), random);
      if (!seen.insert(files).second) continue;
      ++tally.points;
      const std::string problem = check(n, files);
      if (!problem.empty() && ++tally.bad <= kMaxExamples) {
        tally.examples.push_back(
            absl::StrFormat("seed %d, after operation %d of %d, mode %d: %s",
                            seed, n, log.size(), mode, problem));
      }
    }
  }
  tally.operations += log.size();
}

int CrashPointsMain(int argc, char** argv, const CrashTest& test) {
  CLI::App app(test.what);
  CrashTally tally = {.wanted_points = 20'000};
  std::uint64_t seed = 1;
  bool control = false;
  std::string out;
  app.add_option("--points", tally.wanted_points, "Crash points to check");
  app.add_option("--seed", seed, "Of the workload and the cuts");
  app.add_flag(test.control_flag, control, "The negative control");
  app.add_option("--out", out, "Result as JSON")->type_name("FILE");
  CLI11_PARSE(app, argc, argv);

  const auto start = std::chrono::steady_clock::now();
  const auto seconds = [&] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() -
                                         start)
        .count();
  };
  for (std::uint64_t round = seed; tally.points < tally.wanted_points;
       round += 1000) {
    test.round(round, control, tally);
    absl::FPrintF(stderr, "%s %d of %d, %d bad, %.0f s\n", test.name,
                  tally.points, tally.wanted_points, tally.bad, seconds());
  }
  for (const std::string& example : tally.examples) {
    absl::FPrintF(stderr, "bad: %s\n", example);
  }
  const nlohmann::ordered_json document = {
      {"test", control ? test.name + "_control" : test.name},
      {"seed", seed},
      {"points", tally.points},
      {"bad", tally.bad},
      {"operations", tally.operations},
      {test.unit, tally.units},
      {"recoveries_cut", tally.recoveries_cut},
      {"seconds", seconds()}};
  if (!out.empty()) std::ofstream(out) << document.dump(2) << "\n";
  return tally.bad == 0 ? 0 : 1;
}

}  // namespace fathom::fault
