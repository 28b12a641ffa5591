// Consistency and prediction: ContactConsistencyFigures, ContactOptimumFigures,
// ContactPredictionFigures.

#include "tests/accuracy/contacts.h"

#include <Eigen/LU>
#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <optional>
#include <span>
#include <utility>

#include "tests/accuracy/contact_optimum.h"
#include "tests/accuracy/contact_runs.h"

namespace fathom::accuracy {
namespace {

// The bounds are those of 100 runs; ten times as many are made, so that the
// figures are the filter's and not the seeds'.
constexpr int kRuns = 100;
constexpr int kSets = 10;

// chi^2 / 100 at 2.5 and 97.5 %, 4 and 2 degrees of freedom
// (reference/nrl_reference_octave.txt, "0.95,4,100" and "0.95,2,100").
constexpr double kNeesLow = 3.4648;
constexpr double kNeesHigh = 4.5731;
constexpr double kNisLow = 1.6273;
constexpr double kNisHigh = 2.4106;

struct Scene {
  std::string name;
  Encounter encounter;
};

std::vector<Scene> Scenes() {
  const map::ContactClassParameters& vessel =
      map::DefaultContactClasses()[static_cast<std::size_t>(
          map::ContactClass::kVessel)];
  std::vector<Scene> scenes;
  for (const double range_m : {1000.0, 10'000.0}) {
    for (const double bearing_deg : {0.5, 2.5}) {
      for (const int noise : {1, 2, 4}) {
        Scene scene;
        char name[64];
        std::snprintf(name, sizeof name, "%g_km_%gx_%g_deg", range_m / 1000,
                      1.0 * noise, bearing_deg * noise);
        scene.name = name;
        scene.encounter = {.contact = {0.8 * range_m, 0.6 * range_m, 0, 0},
                           .velocity_std_m_s = vessel.first_velocity_std_m_s,
                           .process_noise_m2_s3 = vessel.process_noise_m2_s3,
                           .vehicle_m_s = {1.5, -1.0},
                           .range_std_m = 10.0 * noise,
                           .bearing_std_deg = bearing_deg * noise};
        scenes.push_back(scene);
      }
    }
  }
  return scenes;
}

// What the runs of one filter come to.
struct Consistency {
  double nees = 0;
  double nis = 0;
  // Share of instants and sets whose mean over 100 runs is in the bounds: 0.95
  // of a filter that is exactly right.
  double nees_inside = 0;
  double nis_inside = 0;
  double rmse_m = 0;  // Of the position, second half of the run.
  int gated = 0;
};

Consistency Measure(const Encounter& encounter, map::FilterKind filter) {
  const auto reports = static_cast<std::size_t>(encounter.reports);
  const auto count = static_cast<double>(reports);
  double square_m2 = 0;
  Consistency result;
  for (std::uint64_t set = 0; set < kSets; ++set) {
    std::vector<double> nees(reports);
    std::vector<double> nis(reports);
    for (std::uint64_t run = 1; run <= kRuns; ++run) {
      map::ContactMap map(map::ContactMapOptions{.filter = filter});
      const std::vector<Moment> moments =
          Run(encounter, std::uint64_t{kRuns} * set + run);
      for (std::size_t i = 0; i < reports; ++i) {
        const map::ContactOutcome outcome = map.Apply(moments[i].report);
        result.gated += outcome.applied ? 0 : 1;
        nis[i] += outcome.nis.value_or(0) / kRuns;
        const map::ContactEstimate estimate =
            *map.View().At(moments[i].report.key, moments[i].report.time);
        const Eigen::Vector4d error = ErrorOf(estimate, moments[i].truth);
        nees[i] += error.dot(estimate.P.inverse() * error) / kRuns;
        if (2 * i >= reports) square_m2 += error.head<2>().squaredNorm();
      }
    }
    for (std::size_t i = 0; i < reports; ++i) {
      result.nees += nees[i] / count / kSets;
      if (nees[i] > kNeesLow && nees[i] < kNeesHigh) {
        result.nees_inside += 1 / count / kSets;
      }
      if (i == 0) continue;  // Nothing was foretold.
      result.nis += nis[i] / (count - 1) / kSets;
      if (nis[i] > kNisLow && nis[i] < kNisHigh) {
        result.nis_inside += 1 / (count - 1) / kSets;
      }
    }
  }
  result.rmse_m = std::sqrt(square_m2 / kSets / kRuns / std::floor(count / 2));
  return result;
}

// rmse_m of a filter that is told the true direction and distance for its
// weights (not for its measurement): all that is left to it is the noise and
// the accelerations, so what it cannot do nobody can. Its own covariances, for
// they are then right, over the same truths.
double ToldM(const Encounter& encounter) {
  const auto reports = static_cast<std::size_t>(encounter.reports);
  const double bearing_std_rad =
      encounter.bearing_std_deg * std::numbers::pi / 180;
  double square_m2 = 0;
  for (std::uint64_t run = 1; run <= kSets * kRuns; ++run) {
    map::TrackState state;
    const std::vector<Moment> moments = Run(encounter, run);
    for (std::size_t i = 0; i < reports; ++i) {
      const Eigen::Vector2d away =
          moments[i].truth.head<2>() - moments[i].vehicle;
      const map::PositionMeasurement measured =
          map::ConvertPlain({.range_m = away.norm(),
                             .azimuth_rad = std::atan2(away.y(), away.x()),
                             .range_std_m = encounter.range_std_m,
                             .azimuth_std_rad = bearing_std_rad});
      state = i == 0 ? map::FirstState(measured, encounter.velocity_std_m_s)
                     : map::Update(map::FilterKind::kFourState,
                                   map::Predict(state, encounter.step_s,
                                                encounter.process_noise_m2_s3),
                                   measured)
                           .state;
      if (2 * i >= reports) square_m2 += state.P(0, 0) + state.P(1, 1);
    }
  }
  const double half = std::floor(static_cast<double>(reports) / 2);
  return std::sqrt(square_m2 / kSets / kRuns / half);
}

// Root mean square errors of the position at the same instants of the same
// runs, by both filters and by the mean of the posterior: no estimator's is
// less but by chance.
struct Optimum {
  double optimal_rmse_m = 0;
  double rmse_m = 0;
  double per_axis_rmse_m = 0;
  // The share of the posterior's variance that sampling added to the optimum's
  // mean square error: the mean of 1 / effective_samples.
  double sampling_share = 0;
};

Optimum MeasureOptimum(const Encounter& encounter) {
  constexpr int kOptimumRuns = 300;
  constexpr int kSamples = 1000;
  // Of 61 reports: after three quarters and all.
  constexpr std::array<std::size_t, 2> kInstants = {45, 60};
  Optimum optimum;
  const auto add = [&](const Eigen::Vector4d& error, double& to) {
    to += error.head<2>().squaredNorm() / kOptimumRuns / kInstants.size();
  };
  for (std::uint64_t run = 1; run <= kOptimumRuns; ++run) {
    const std::vector<Moment> moments = Run(encounter, run);
    for (const auto& [filter, sum] :
         {std::pair(map::FilterKind::kFourState, &optimum.rmse_m),
          std::pair(map::FilterKind::kPerAxis, &optimum.per_axis_rmse_m)}) {
      map::ContactMap map(map::ContactMapOptions{.filter = filter});
      std::size_t next = 0;
      for (const std::size_t instant : kInstants) {
        while (next <= instant) (void)map.Apply(moments[next++].report);
        const Moment& now = moments[instant];
        add(ErrorOf(*map.View().At(now.report.key, now.report.time), now.truth),
            *sum);
      }
    }
    for (const std::size_t instant : kInstants) {
      const PosteriorMean mean = MeanOfPosterior(
          encounter, std::span(moments).first(instant + 1), kSamples, run);
      add(mean.x - moments[instant].truth, optimum.optimal_rmse_m);
      optimum.sampling_share +=
          1 / mean.effective_samples / kOptimumRuns / kInstants.size();
    }
  }
  for (double* square :
       {&optimum.optimal_rmse_m, &optimum.rmse_m, &optimum.per_axis_rmse_m}) {
    *square = std::sqrt(*square);
  }
  return optimum;
}

}  // namespace

nlohmann::json ContactConsistencyFigures() {
  auto rows = nlohmann::json::array();
  for (const Scene& scene : Scenes()) {
    const Consistency ours =
        Measure(scene.encounter, map::FilterKind::kFourState);
    const Consistency theirs =
        Measure(scene.encounter, map::FilterKind::kPerAxis);
    const double told_m = ToldM(scene.encounter);
    rows.push_back({{"scene", scene.name},
                    {"nees", ours.nees},
                    {"nees_inside_percent", 100 * ours.nees_inside},
                    {"nis", ours.nis},
                    {"nis_inside_percent", 100 * ours.nis_inside},
                    {"gated", ours.gated},
                    {"rmse_m", ours.rmse_m},
                    {"per_axis_rmse_m", theirs.rmse_m},
                    {"per_axis_nees", theirs.nees},
                    {"per_axis_gated", theirs.gated},
                    {"rmse_ratio", ours.rmse_m / theirs.rmse_m},
                    {"told_rmse_m", told_m},
                    {"over_told", ours.rmse_m / told_m},
                    {"told_ratio", told_m / theirs.rmse_m},
                    {"bearing_std_deg", scene.encounter.bearing_std_deg}});
  }
  return rows;
}

nlohmann::json ContactOptimumFigures() {
  auto rows = nlohmann::json::array();
  for (const Scene& scene : Scenes()) {
    const Optimum optimum = MeasureOptimum(scene.encounter);
    rows.push_back(
        {{"scene", scene.name},
         {"optimal_rmse_m", optimum.optimal_rmse_m},
         {"rmse_m", optimum.rmse_m},
         {"per_axis_rmse_m", optimum.per_axis_rmse_m},
         {"over_optimal", optimum.rmse_m / optimum.optimal_rmse_m},
         {"rmse_ratio", optimum.rmse_m / optimum.per_axis_rmse_m},
         {"optimal_ratio", optimum.optimal_rmse_m / optimum.per_axis_rmse_m},
         {"sampling_share", optimum.sampling_share},
         {"bearing_std_deg", scene.encounter.bearing_std_deg}});
  }
  return rows;
}

nlohmann::json ContactPredictionFigures() {
  auto rows = nlohmann::json::array();
  const std::vector<Scene> scenes = Scenes();
  for (const int minutes : {0, 1, 5, 10}) {
    // The ellipse of share p holds d^2 <= -2 ln(1 - p).
    constexpr double kShares[3] = {0.5, 0.9, 0.99};
    double inside[3] = {};
    double count = 0;
    for (const Scene& scene : scenes) {
      for (std::uint64_t run = 1; run <= kSets * kRuns; ++run) {
        map::ContactMap map(map::ContactMapOptions{});
        const std::vector<Moment> moments = Run(scene.encounter, 1000 + run);
        for (std::size_t i = 0; i < moments.size(); ++i) {
          map.Apply(moments[i].report);
          if (i % 30 != 29) continue;  // After 5 and 10 minutes.
          const double ahead_s = 60.0 * minutes;
          const map::ContactEstimate foretold = *map.View().At(
              moments[i].report.key, AtS(moments[i].at_s + ahead_s));
          const Eigen::Vector2d error =
              ErrorOf(foretold, Ahead(scene.encounter, moments[i].truth,
                                      ahead_s, 7 * run + i))
                  .head<2>();
          const Eigen::Matrix2d P = foretold.P.topLeftCorner<2, 2>();
          const double square = error.dot(P.inverse() * error);
          for (int k = 0; k < 3; ++k) {
            inside[k] += square <= -2 * std::log(1 - kShares[k]) ? 1 : 0;
          }
          count += 1;
        }
      }
    }
    rows.push_back({{"minutes", minutes},
                    {"predictions", count},
                    {"within_50_percent", 100 * inside[0] / count},
                    {"within_90_percent", 100 * inside[1] / count},
                    {"within_99_percent", 100 * inside[2] / count}});
  }
  return rows;
}

}  // namespace fathom::accuracy
