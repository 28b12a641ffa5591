// `fathom-feeder evaluate`: asks the server and compares with the truth that
// it has never seen.
//
// Depth: at random places inside the area the server states mean, std and
// kind of evidence; errors are counted apart by kind, because a measured cell
// and one smoothed from its neighbours make different promises.
//
// Obstacles: at each place a depth z is drawn within three stated deviations
// of the stated mean, so z depends on the map alone and "the seabed is at z or
// shallower" must come true as often as stated: Brier score and reliability
// table. Places where a contact adds to the probability are left out of it.
//
// Contacts: their estimates after each report (GetContactHistory), and
// predicted beyond the run's end, against the true ways of the ships in the
// survey record.

#ifndef FATHOM_SIM_FEEDER_EVALUATE_COMMAND_H_
#define FATHOM_SIM_FEEDER_EVALUATE_COMMAND_H_

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "client/client.h"
#include "fathom/v1/types.pb.h"
#include "sim_feeder/link.h"
#include "sim_feeder/local_terrain.h"
#include "sim_feeder/score.h"
#include "sim_feeder/survey_record.h"
#include "sim_feeder/truth_source.h"

namespace fathom::feeder {

// Truth is asked inside the area only: what a seabed needs about it, metres.
inline constexpr double kEvaluationMarginM = 50.0;

// Places that are asked about unless it is said.
inline constexpr std::uint64_t kDefaultPoints = 20'000;

struct EvaluateOptions {
  // Server and certificates.
  LinkOptions link;
  TruthOptions truth;
  // A survey record, for area, ships and times; or only an area.
  std::string survey_path;
  SurveyArea area;
  std::optional<Time> time;
  std::uint64_t seed = 1;
  // How many places, 1 to 10 M.
  std::uint64_t points = kDefaultPoints;
  // Not empty: evaluation_files.h into this folder.
  std::string out;
  bool json = false;
};

// One place: what is there, and what the map says.
struct PlaceAnswer {
  // In the plane about the area's south-west corner, metres.
  double north_m = 0;
  double east_m = 0;
  double truth_m = 0;
  // Not above 0 where the map states none.
  float std_m = 0;
  float mean_m = 0;
  v1::EvidenceKind kind = v1::EVIDENCE_KIND_UNSPECIFIED;
};

struct DepthEvaluation {
  std::map<v1::EvidenceKind, DepthScore> by_kind;
  ReliabilityScore reliability;
  // Places asked; without truth there; unknown to the server; said to be land
  // and truly at or above the zero, and truly wet; left out of the
  // reliability because of a contact.
  std::uint64_t points = 0;
  std::uint64_t without_truth = 0;
  std::uint64_t unknown = 0;
  std::uint64_t land_right = 0;
  std::uint64_t land_wrong = 0;
  std::uint64_t near_contact = 0;
  // Those with a truth, in the order asked.
  std::vector<PlaceAnswer> places;
};

// One estimate of a contact and where it truly was, in the plane about the
// area's south-west corner.
struct TrackPoint {
  double at_s = 0;  // Since the start of the run.
  PlanePoint truth;
  PlanePoint estimate;
  PositionCovariance covariance;
};

struct ContactTrack {
  std::string contact_id;
  std::vector<TrackPoint> points = {};
};

struct ContactEvaluation {
  // The stored estimates after each report, from the second minute on.
  ContactScore during;
  // Predicted this many seconds past the end of the run.
  std::map<int, ContactScore> predicted;
  // Questions about a ship that the server had no estimate for.
  std::uint64_t missing = 0;
  // What `during` counts, by ship; ships without estimates are left out.
  std::vector<ContactTrack> tracks;
};

// Errors: of the queries.
absl::StatusOr<DepthEvaluation> EvaluateDepth(const client::Client& client,
                                              const LocalTerrain& seabed,
                                              const SurveyArea& area, Time time,
                                              std::uint64_t seed,
                                              std::uint64_t points);
absl::StatusOr<ContactEvaluation> EvaluateContacts(const client::Client& client,
                                                   const SurveyRecord& survey);

struct Evaluation {
  DepthEvaluation depth;
  ContactEvaluation contacts;
};

// Both, the depth of the survey's area at `time`. Errors: of the truth, the
// connection and the queries.
absl::StatusOr<Evaluation> EvaluateSurvey(const LinkOptions& link,
                                          const TruthSource& truth,
                                          const SurveyRecord& survey, Time time,
                                          std::uint64_t seed,
                                          std::uint64_t points);

// The whole command. Prints a table, or one line of JSON.
absl::Status Evaluate(const EvaluateOptions& options);

}  // namespace fathom::feeder

#endif  // FATHOM_SIM_FEEDER_EVALUATE_COMMAND_H_
