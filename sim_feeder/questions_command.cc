#include "sim_feeder/questions_command.h"

#include <chrono>

#include "absl/strings/str_format.h"
#include "map/geodesy/ned_frame.h"
#include "sim_feeder/random.h"

namespace fathom::feeder {
namespace {

constexpr std::uint64_t kMaxQuestions = 1'000'000;
constexpr double kDeepestM = 60.0;
constexpr double kFutureS = 900.0;

}  // namespace

absl::StatusOr<std::string> MakeQuestions(const SurveyRecord& survey,
                                          std::uint64_t seed,
                                          std::uint64_t count) {
  if (count < 1 || count > kMaxQuestions) {
    return absl::InvalidArgumentError(
        absl::StrFormat("count=%d must be 1 to %d", count, kMaxQuestions));
  }
  Random random(seed, RandomStream::kEvaluation);
  const map::NedFrame frame(survey.area.south_west);
  const double duration_s = ToSeconds(survey.end_time - survey.start_time);
  std::string text = "latitude_deg,longitude_deg,depth_m,time\n";
  for (std::uint64_t i = 0; i < count; ++i) {
    const map::GeodeticPoint place =
        frame.ToGeodetic(random.Uniform(-0.2, 1.2) * survey.area.north_extent_m,
                         random.Uniform(-0.2, 1.2) * survey.area.east_extent_m);
    const double depth_m = random.Uniform(0.0, kDeepestM);
    // Whole seconds, so that the text states the time exactly.
    const Time time =
        survey.start_time +
        std::chrono::seconds(static_cast<std::int64_t>(
            random.Uniform(-0.1 * duration_s, duration_s + kFutureS)));
    text += absl::StrFormat("%.8f,%.8f,%.3f,%s\n", place.latitude_deg,
                            place.longitude_deg, depth_m, FormatTime(time));
  }
  return text;
}

}  // namespace fathom::feeder
