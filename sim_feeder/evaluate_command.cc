#include "sim_feeder/evaluate_command.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "absl/strings/str_format.h"
#include "base/clock.h"
#include "base/status_macros.h"
#include "client/proto_time.h"
#include "map/geodesy/ned_frame.h"
#include "sim_feeder/evaluation_files.h"
#include "sim_feeder/evaluation_report.h"
#include "sim_feeder/random.h"

namespace fathom::feeder {
namespace {

// Points in one question: far below every server's limit.
constexpr std::size_t kBatch = 4'096;
constexpr std::uint64_t kMaxPoints = 10'000'000;
// Estimates before this have not seen the ship move.
constexpr double kSettlingS = 60.0;

struct Place {
  map::GeodeticPoint position;
  double truth_m;
  double north_m;
  double east_m;
};

absl::StatusOr<v1::QueryObstaclesResponse> Ask(
    const client::Client& client, const std::vector<Place>& places,
    const std::vector<float>& depths_m, Time time) {
  v1::QueryObstaclesRequest request;
  for (const Place& place : places) {
    request.add_latitude_deg(place.position.latitude_deg);
    request.add_longitude_deg(place.position.longitude_deg);
  }
  request.mutable_depth_m()->Add(depths_m.begin(), depths_m.end());
  *request.mutable_time() = client::ToProto(time);
  request.set_confidence(0.95);
  request.set_with_reasons(true);
  FATHOM_ASSIGN_OR_RETURN(v1::QueryObstaclesResponse response,
                          client.QueryObstacles(request));
  const int count = static_cast<int>(places.size());
  if (response.probability_size() != count ||
      response.mean_depth_m_size() != count || response.std_m_size() != count ||
      response.kind_size() != count) {
    return absl::InternalError(
        absl::StrFormat("the server answered %d of %d points",
                        response.probability_size(), count));
  }
  return response;
}

// Counts one batch of depths; returns the depths for the second question.
std::vector<float> CountDepths(const std::vector<Place>& places,
                               const v1::QueryObstaclesResponse& response,
                               Random& random, DepthEvaluation& result) {
  std::vector<float> depths_m;
  depths_m.reserve(places.size());
  for (std::size_t i = 0; i < places.size(); ++i) {
    const int k = static_cast<int>(i);
    const double mean_m = response.mean_depth_m(k);
    const double std_m = response.std_m(k);
    const v1::EvidenceKind kind = response.kind(k);
    result.places.push_back({.north_m = places[i].north_m,
                             .east_m = places[i].east_m,
                             .truth_m = places[i].truth_m,
                             .std_m = response.std_m(k),
                             .mean_m = response.mean_depth_m(k),
                             .kind = kind});
    // Drawn for every place, so that one answer does not shift the others.
    const double offset = random.Uniform(-3.0, 3.0);
    if (kind == v1::EVIDENCE_KIND_LAND) {
      ++(places[i].truth_m <= 0.0 ? result.land_right : result.land_wrong);
    } else if (kind == v1::EVIDENCE_KIND_UNSPECIFIED || !(std_m > 0.0)) {
      ++result.unknown;
    } else {
      result.by_kind[kind].Add(mean_m, std_m, places[i].truth_m);
      depths_m.push_back(static_cast<float>(
          std::clamp(mean_m + offset * std_m, -100.0, 12'000.0)));
      continue;
    }
    depths_m.push_back(0.0f);
  }
  return depths_m;
}

void CountObstacles(const std::vector<Place>& places,
                    const std::vector<float>& depths_m,
                    const v1::QueryObstaclesResponse& response,
                    DepthEvaluation& result) {
  std::vector<bool> touched(places.size());
  for (const v1::PointContact& contact : response.contacts()) {
    if (contact.point_index() < places.size()) {
      touched[contact.point_index()] = true;
    }
  }
  for (std::size_t i = 0; i < places.size(); ++i) {
    const int k = static_cast<int>(i);
    const v1::EvidenceKind kind = response.kind(k);
    if (kind == v1::EVIDENCE_KIND_UNSPECIFIED ||
        kind == v1::EVIDENCE_KIND_LAND || !(response.std_m(k) > 0.0f)) {
      continue;
    }
    if (touched[i]) {
      ++result.near_contact;
      continue;
    }
    result.reliability.Add(
        std::clamp<double>(response.probability(k), 0.0, 1.0),
        places[i].truth_m <= depths_m[i]);
  }
}

// Adds one estimate, which must be for `seconds` after the survey's start;
// tells where it was.
TrackPoint AddEstimate(const SurveyRecord& survey, const Ship& ship,
                       double seconds, const v1::ContactEstimate& estimate,
                       ContactScore& score) {
  const PlanePoint truth = ship.PlaceAt(seconds);
  const map::NedFrame here(
      {.latitude_deg = estimate.position().latitude_deg(),
       .longitude_deg = estimate.position().longitude_deg()});
  const map::NedPoint away =
      here.ToNed(map::NedFrame(survey.area.south_west)
                     .ToGeodetic(truth.north_m, truth.east_m));
  // Row-major upper triangle: nn ne n.vn n.ve ee ...
  const PositionCovariance covariance = {.nn = estimate.covariance(0),
                                         .ne = estimate.covariance(1),
                                         .ee = estimate.covariance(4)};
  score.Add(-away.north_m, -away.east_m, covariance);
  return {.at_s = seconds,
          .truth = truth,
          .estimate = {.north_m = truth.north_m - away.north_m,
                       .east_m = truth.east_m - away.east_m},
          .covariance = covariance};
}

// The stored estimates after each report.
absl::Status AddHistory(const client::Client& client,
                        const SurveyRecord& survey, const Ship& ship,
                        ContactEvaluation& result) {
  v1::GetContactHistoryRequest request;
  request.set_source_id(survey.source_id);
  request.set_contact_id(ship.id);
  *request.mutable_start_time() = client::ToProto(survey.start_time);
  *request.mutable_end_time() = client::ToProto(survey.end_time);
  const absl::StatusOr<std::vector<v1::ContactEstimate>> history =
      client.GetContactHistory(request);
  if (absl::IsNotFound(history.status())) {
    ++result.missing;
    return absl::OkStatus();
  }
  FATHOM_RETURN_IF_ERROR(history.status());
  ContactTrack track = {.contact_id = ship.id};
  for (const v1::ContactEstimate& estimate : *history) {
    const double seconds =
        ToSeconds(client::FromProto(estimate.time()) - survey.start_time);
    if (seconds < kSettlingS || estimate.covariance_size() != 10) continue;
    track.points.push_back(
        AddEstimate(survey, ship, seconds, estimate, result.during));
  }
  if (!track.points.empty()) result.tracks.push_back(std::move(track));
  return absl::OkStatus();
}

// All ships at one moment, as the server predicts them.
absl::Status AddPrediction(const client::Client& client,
                           const SurveyRecord& survey, double seconds,
                           ContactScore& score, std::uint64_t& missing) {
  v1::ListContactsRequest request;
  *request.mutable_time() = client::ToProto(
      survey.start_time + std::chrono::duration_cast<Duration>(
                              std::chrono::duration<double>(seconds)));
  request.set_include_inactive(true);
  FATHOM_ASSIGN_OR_RETURN(const v1::ListContactsResponse response,
                          client.ListContacts(request));
  for (const Ship& ship : survey.ships) {
    const auto found =
        std::find_if(response.contacts().begin(), response.contacts().end(),
                     [&](const v1::ContactEstimate& contact) {
                       return contact.contact_id() == ship.id &&
                              contact.source_id() == survey.source_id;
                     });
    if (found == response.contacts().end() || found->covariance_size() != 10) {
      ++missing;
      continue;
    }
    AddEstimate(survey, ship, seconds, *found, score);
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<DepthEvaluation> EvaluateDepth(const client::Client& client,
                                              const LocalTerrain& seabed,
                                              const SurveyArea& area, Time time,
                                              std::uint64_t seed,
                                              std::uint64_t points) {
  Random random(seed, RandomStream::kEvaluation);
  DepthEvaluation result;
  while (result.points < points) {
    std::vector<Place> places;
    while (places.size() < kBatch && result.points < points) {
      ++result.points;
      const double north_m = random.Uniform(0.0, area.north_extent_m);
      const double east_m = random.Uniform(0.0, area.east_extent_m);
      const std::optional<double> truth_m = seabed.DepthAt(north_m, east_m);
      if (!truth_m.has_value()) {
        ++result.without_truth;
        continue;
      }
      places.push_back({.position = seabed.frame().ToGeodetic(north_m, east_m),
                        .truth_m = *truth_m,
                        .north_m = north_m,
                        .east_m = east_m});
    }
    if (places.empty()) break;
    FATHOM_ASSIGN_OR_RETURN(
        const v1::QueryObstaclesResponse depths,
        Ask(client, places, std::vector<float>(places.size(), 0.0f), time));
    const std::vector<float> asked_m =
        CountDepths(places, depths, random, result);
    FATHOM_ASSIGN_OR_RETURN(const v1::QueryObstaclesResponse obstacles,
                            Ask(client, places, asked_m, time));
    CountObstacles(places, asked_m, obstacles, result);
  }
  return result;
}

absl::StatusOr<ContactEvaluation> EvaluateContacts(const client::Client& client,
                                                   const SurveyRecord& survey) {
  ContactEvaluation result;
  if (survey.ships.empty()) return result;
  for (const Ship& ship : survey.ships) {
    FATHOM_RETURN_IF_ERROR(AddHistory(client, survey, ship, result));
  }
  const double duration_s = ToSeconds(survey.end_time - survey.start_time);
  for (const int horizon_s : {0, 60, 300, 600}) {
    FATHOM_RETURN_IF_ERROR(AddPrediction(client, survey, duration_s + horizon_s,
                                         result.predicted[horizon_s],
                                         result.missing));
  }
  return result;
}

absl::StatusOr<Evaluation> EvaluateSurvey(const LinkOptions& link,
                                          const TruthSource& truth,
                                          const SurveyRecord& survey, Time time,
                                          std::uint64_t seed,
                                          std::uint64_t points) {
  FATHOM_ASSIGN_OR_RETURN(const std::shared_ptr<const LocalTerrain> seabed,
                          truth.SeabedAbout(survey.area, kEvaluationMarginM));
  FATHOM_ASSIGN_OR_RETURN(const std::unique_ptr<client::Client> client,
                          Connect(link));
  Evaluation evaluation;
  FATHOM_ASSIGN_OR_RETURN(
      evaluation.depth,
      EvaluateDepth(*client, *seabed, survey.area, time, seed, points));
  FATHOM_ASSIGN_OR_RETURN(evaluation.contacts,
                          EvaluateContacts(*client, survey));
  return evaluation;
}

absl::Status Evaluate(const EvaluateOptions& options) {
  if (options.points < 1 || options.points > kMaxPoints) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "points=%d must be 1 to %d", options.points, kMaxPoints));
  }
  SurveyRecord survey;
  survey.area = options.area;
  survey.end_time = SystemClock().Now();
  if (!options.survey_path.empty()) {
    FATHOM_ASSIGN_OR_RETURN(survey, LoadSurveyRecord(options.survey_path));
  }
  FATHOM_ASSIGN_OR_RETURN(const TruthSource truth,
                          TruthSource::Load(options.truth));
  FATHOM_ASSIGN_OR_RETURN(const Evaluation judged,
                          EvaluateSurvey(options.link, truth, survey,
                                         options.time.value_or(survey.end_time),
                                         options.seed, options.points));
  const auto& [depth, contacts] = judged;
  if (!options.out.empty()) {
    FATHOM_RETURN_IF_ERROR(WriteEvaluation(options.out, truth.Describe(),
                                           survey.area, depth, contacts));
  }
  const std::string report = options.json ? EvaluationJson(depth, contacts)
                                          : EvaluationTable(depth, contacts);
  absl::PrintF("%s\n", report);
  return absl::OkStatus();
}

}  // namespace fathom::feeder
