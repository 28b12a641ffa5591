#include "tests/accuracy/limits.h"

#include <cmath>
#include <string>

#include "tests/accuracy/limit.h"

namespace fathom::accuracy {
namespace {

constexpr double kNormalPercent[3] = {68.27, 95.45, 99.73};
constexpr double kPoints[3] = {5, 3, 1};

}  // namespace

int CheckLimits(const nlohmann::json& report) {
  int missed = 0;
  const auto rows = [&report](const char* figure) {
    return report.value(figure, nlohmann::json::array());
  };
  std::printf("\nlimits\n");

  Limit optimal("rmse / (sigma / sqrt n), consistent pings, adaptive", 1.10);
  for (const auto& row : rows("optimal")) {
    optimal.Offer(row["adaptive"], Where(row));
  }
  missed += optimal.Report();

  for (int k = 0; k < 3; ++k) {
    const std::string key = "within_" + std::to_string(k + 1) + "std_percent";
    Limit measured("measured cells: points off the normal share, " +
                       std::to_string(k + 1) + " std",
                   kPoints[k]);
    for (const auto& row : rows("coverage")) {
      if (row["estimator"] != "adaptive") continue;
      measured.Offer(std::abs(row[key].get<double>() - kNormalPercent[k]),
                     Where(row));
    }
    missed += measured.Report();
    Limit bold("smoothed cells: points below the normal share, " +
                   std::to_string(k + 1) + " std",
               kPoints[k]);
    Limit timid(
        "smoothed cells: points above it, " + std::to_string(k + 1) + " std",
        15);
    for (const auto& row : rows("smoothed")) {
      const double off = row[key].get<double>() - kNormalPercent[k];
      bold.Offer(-off, Where(row));
      timid.Offer(off, Where(row));
    }
    missed += bold.Report() + timid.Report();
  }

  Limit bins("stated against observed probability, all scenes", 0.03);
  Limit free("answers FREE at 0.95 that are wrong, percent", 5);
  Limit brier("Brier score over the better of nervegna and kalman", 1);
  double ours = 0;
  double others = 1;
  for (const auto& row : rows("reliability")) {
    if (row["scene"] != "all") {
      if (row["estimator"] == "adaptive") {
        free.Offer(row["free_wrong_percent"], Where(row));
      }
    } else if (row["estimator"] == "adaptive") {
      bins.Offer(row["worst_bin"], Where(row));
      ours = row["brier"];
    } else {
      others = std::min(others, row["brier"].get<double>());
    }
  }
  if (ours != 0) brier.Offer(ours / others, "all");
  missed += bins.Report() + free.Report() + brier.Report();

  Limit prior("rmse with a prior 15 m off / without, two hits", 1.10);
  for (const auto& row : rows("bad_prior")) {
    if (row["hits"] == 2) prior.Offer(row["rmse_ratio"], Where(row));
  }
  missed += prior.Report();

  Limit rocks("charted hazards answered FREE once hit", 0);
  for (const auto& row : rows("hazards")) {
    if (row["rocks"] == 0) continue;  // No chart here.
    rocks.Offer(row["free"], Where(row));
  }
  missed += rocks.Report();

  // "99.9 % confidence".
  Limit row_error("thesis fig. 6-1: percent of cells beyond 3 std", 0.1);
  for (const auto& row : rows("thesis_local")) {
    row_error.Offer(100 - row["within_3std_percent"].get<double>(), Where(row));
  }
  missed += row_error.Report();

  Limit leaves("thesis scene 6.1.2: median leaves", 560);
  Limit bytes("thesis scene: bytes of the global map, median", 10'000);
  Limit drift("thesis scene: drift of a fine mean, m", 0.5001);
  for (const auto& row : rows("thesis_scene")) {
    leaves.Offer(row["median_leaves"], "coast");
    bytes.Offer(row["median_bytes"], "coast");
    drift.Offer(row["worst_m"], "coast");
  }
  missed += leaves.Report() + bytes.Report() + drift.Report();
  return missed;
}

}  // namespace fathom::accuracy
