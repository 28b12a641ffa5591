// Any number of places in one call: split into requests of the size that the
// server allows, and their answers put together again.
//
//   FATHOM_ASSIGN_OR_RETURN(const PointAnswers answers,
//                           AskPoints(*client, common, points, now));
//   if (answers.state[0] == v1::OBSTACLE_STATE_FREE) ...
//
// Thread-safe, as the client is.

#ifndef FATHOM_CLIENT_POINT_QUESTIONS_H_
#define FATHOM_CLIENT_POINT_QUESTIONS_H_

#include <optional>
#include <vector>

#include "absl/status/statusor.h"
#include "base/time.h"
#include "client/client.h"

namespace fathom::client {

// One place asked about; degrees, and metres positive down from what the
// request's vertical_reference says.
struct QuestionPoint {
  double latitude_deg = 0;
  double longitude_deg = 0;
  double depth_m = 0;
  // Absent: the time asked for all.
  std::optional<Time> time = std::nullopt;
};

// Answers in the order of the questions: all arrays are as long as they, but
// for `contacts`. Units as in v1::QueryObstaclesResponse.
struct PointAnswers {
  std::vector<float> probability;
  std::vector<v1::ObstacleState> state;
  // With reasons, else NaN (kind: UNSPECIFIED); NaN where unknown, on land
  // depth and std too.
  std::vector<float> mean_depth_m;
  std::vector<float> std_m;
  std::vector<float> age_s;
  std::vector<float> hazard_m;
  std::vector<v1::EvidenceKind> kind;
  // With reasons: contacts that contribute, by point_index, which counts
  // through all parts.
  std::vector<v1::PointContact> contacts;
  // Of the first part. Each part is answered from one view of the map; later
  // parts from one at least as new.
  v1::MapStamp stamp;
};

// Asks in parts of at most Limits.max_points_per_query, one after the other.
// `common` holds what all share (confidence, clearance, with_reasons, ...; its
// own points and times are replaced); `time` is for points without their own
// (absent: now). No points: no answers, and nothing is asked.
//
// Errors: as Client::QueryObstacles of the first part that fails; INTERNAL
// when a server answers another number of points than it was asked. Cost: one
// call for the limit and one for each part.
absl::StatusOr<PointAnswers> AskPoints(const Client& client,
                                       const v1::QueryObstaclesRequest& common,
                                       const std::vector<QuestionPoint>& points,
                                       std::optional<Time> time);

}  // namespace fathom::client

#endif  // FATHOM_CLIENT_POINT_QUESTIONS_H_
