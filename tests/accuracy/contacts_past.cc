// The past of contacts that were heard for more than an hour:
// ContactPastFigures.

#include <Eigen/LU>
#include <cmath>
#include <string>
#include <vector>

#include "tests/accuracy/contact_runs.h"
#include "tests/accuracy/contacts.h"

namespace fathom::accuracy {
namespace {

constexpr std::uint64_t kRuns = 100;
constexpr double kStepS = 2;
constexpr int kReports = 2251;  // 75 minutes.

struct Heard {
  const char* scene;
  double range_m;
  double range_std_m;
  double bearing_std_deg;
};

constexpr Heard kScenes[] = {{"1_km_0.5_deg", 1000, 10, 0.5},
                             {"10_km_2.5_deg", 10'000, 10, 2.5},
                             {"10_km_5_deg", 10'000, 20, 5}};

// The ellipse of share p holds d^2 <= -2 ln(1 - p).
constexpr double kShares[3] = {0.5, 0.9, 0.99};

}  // namespace

nlohmann::json ContactPastFigures() {
  const std::vector<int> minutes = {1, 10, 60};
  auto rows = nlohmann::json::array();
  for (const Heard& heard : kScenes) {
    const Encounter encounter{
        .contact = {0.8 * heard.range_m, 0.6 * heard.range_m, 0, 0},
        .velocity_std_m_s = 2,
        .process_noise_m2_s3 =
            map::DefaultContactClasses()[static_cast<std::size_t>(
                                             map::ContactClass::kVessel)]
                .process_noise_m2_s3,
        .vehicle_m_s = {0.5, -0.3},
        .range_std_m = heard.range_std_m,
        .bearing_std_deg = heard.bearing_std_deg,
        .step_s = kStepS,
        .reports = kReports};
    struct Past {
      double inside[3] = {};
      double nees = 0;
      double square_m2 = 0;
      double count = 0;
    };
    std::vector<Past> pasts(minutes.size());
    for (std::uint64_t run = 1; run <= kRuns; ++run) {
      map::ContactMap map(map::ContactMapOptions{});
      const std::vector<Moment> moments = Run(encounter, 5000 + run);
      for (std::size_t i = 0; i < moments.size(); ++i) {
        map.Apply(moments[i].report);
        // Asked ten times, 100 s apart, up to the end.
        if (i + 1 < moments.size() - 450 ||
            (moments.size() - 1 - i) % 50 != 0) {
          continue;
        }
        for (std::size_t k = 0; k < minutes.size(); ++k) {
          const Moment& then =
              moments[i - static_cast<std::size_t>(60 * minutes[k] / kStepS)];
          const map::ContactEstimate past =
              *map.View().At(then.report.key, then.report.time);
          const Eigen::Vector4d error = ErrorOf(past, then.truth);
          const Eigen::Matrix2d P = past.P.topLeftCorner<2, 2>();
          const double square =
              error.head<2>().dot(P.inverse() * error.head<2>());
          for (int share = 0; share < 3; ++share) {
            pasts[k].inside[share] +=
                square <= -2 * std::log(1 - kShares[share]) ? 1 : 0;
          }
          pasts[k].nees += error.dot(past.P.inverse() * error);
          pasts[k].square_m2 += error.head<2>().squaredNorm();
          pasts[k].count += 1;
        }
      }
    }
    for (std::size_t k = 0; k < minutes.size(); ++k) {
      const Past& past = pasts[k];
      rows.push_back({{"scene", heard.scene},
                      {"minutes_ago", minutes[k]},
                      {"asked", past.count},
                      {"within_50_percent", 100 * past.inside[0] / past.count},
                      {"within_90_percent", 100 * past.inside[1] / past.count},
                      {"within_99_percent", 100 * past.inside[2] / past.count},
                      {"nees", past.nees / past.count},
                      {"rmse_m", std::sqrt(past.square_m2 / past.count)}});
    }
  }
  return rows;
}

}  // namespace fathom::accuracy
