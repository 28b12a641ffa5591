// The dynamic map against reference numbers, one row a table.

#include "tests/testing/contact_reference.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <limits>

#include "map/query/disc_probability.h"
#include "tests/accuracy/contacts.h"
#include "tests/testing/worse.h"

namespace fathom::accuracy {
namespace {

using map::FilterKind;
using testing::DiscCase;
using testing::ReferenceErrors;

// Puts the table's worst row beside what it may be at most.
class Rows {
 public:
  explicit Rows(std::string folder) : folder_(std::move(folder)) {}

  void Add(const std::string& scene, const std::string& file,
           const ReferenceErrors& errors, double limit) {
    if (errors.empty()) {
      std::printf("skipped: no %s/%s\n", folder_.c_str(), file.c_str());
      return;
    }
    double worst = 0;
    nlohmann::json each = nlohmann::json::array();
    for (const auto& [row, error] : errors) {
      worst = testing::WorseOf(worst, error);
      each.push_back({{"row", row}, {"error", error}});
    }
    rows_.push_back({{"scene", scene},
                     {"cases", errors.size()},
                     {"worst_error", worst},
                     {"limit", limit},
                     {"source", file},
                     {"each", each}});
  }

  void AddDiscs(const std::string& scene, const std::string& source,
                const std::vector<DiscCase>& cases) {
    ReferenceErrors errors;
    double least = 1;
    for (const DiscCase& one : cases) {
      errors.push_back({one.row, testing::RelativeError(one)});
      least = std::min(least, one.probability);
    }
    Add(scene, source, errors, 1e-6);
    if (errors.empty()) return;
    rows_.back()["least_probability"] = least;
    rows_.back()["ns_per_probability"] = NsPerProbability(cases);
  }

  nlohmann::json Take() { return std::move(rows_); }

 private:
  // The best of some rounds: the machine may have other work. No limit stands
  // on it (tests/bench/run shows it beside its target).
  static double NsPerProbability(const std::vector<DiscCase>& cases) {
    using Clock = std::chrono::steady_clock;
    double best = std::numeric_limits<double>::infinity();
    double sum = 0;
    for (int round = 0; round < 20; ++round) {
      const Clock::time_point start = Clock::now();
      for (const DiscCase& one : cases) {
        sum +=
            map::DiscProbability(one.offset_m, one.covariance_m2, one.radius_m);
      }
      const std::chrono::duration<double, std::nano> span =
          Clock::now() - start;
      best = std::min(best, span.count() / static_cast<double>(cases.size()));
    }
    return sum > 0 ? best : std::numeric_limits<double>::infinity();
  }

  std::string folder_;
  nlohmann::json rows_ = nlohmann::json::array();
};

}  // namespace

nlohmann::json ContactReferenceFigures(const std::string& folder) {
  Rows rows(folder);
  const std::string polar = "nrl_reference_octave.txt";
  rows.Add("modified_unbiased_conversion", polar,
           testing::ConversionErrors(folder, FilterKind::kFourState), 1e-9);
  rows.Add("plain_conversion", polar,
           testing::ConversionErrors(folder, FilterKind::kPerAxis), 1e-9);
  rows.Add("kalman_step", "stonesoup_reference.txt",
           testing::KalmanStepErrors(folder), 1e-6);
  const std::string steady = "steady_state_alpha_beta.csv";
  rows.Add("steady_state_four_state", steady,
           testing::SteadyStateErrors(folder, FilterKind::kFourState), 1e-6);
  rows.Add("steady_state_per_axis", steady,
           testing::SteadyStateErrors(folder, FilterKind::kPerAxis), 1e-6);
  rows.AddDiscs("disc_published", "disc_probability_published.csv",
                testing::PublishedDiscs(folder));
  rows.AddDiscs("disc_isotropic", "isotropic_disk_probability.csv",
                testing::IsotropicDiscs(folder));
  rows.AddDiscs("disc_isotropic_to_1e-12", "a series, 2000 seeded cases",
                testing::SummedIsotropicDiscs(2000));
  rows.AddDiscs("disc_any_ellipse_to_1e-12",
                "2000 chords and more, 500 seeded cases",
                testing::SummedEllipticDiscs(500));
  rows.Add("cpa_encounters", "cpa_encounters.csv",
           testing::EncounterErrors(folder), 1);
  ReferenceErrors times;
  ReferenceErrors distances;
  for (const testing::SphereError& error :
       testing::SphereEncounterErrors(folder)) {
    times.push_back({"seconds", error.time_s});
    distances.push_back({"metres", error.distance_m});
  }
  rows.Add("cpa_sphere_time_s", "jord_cpa.csv", times, 8);
  rows.Add("cpa_sphere_distance_m", "jord_cpa.csv", distances, 550);
  return rows.Take();
}

}  // namespace fathom::accuracy
