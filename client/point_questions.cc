#include "client/point_questions.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <utility>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "client/proto_time.h"

namespace fathom::client {
namespace {

// Points of one request to a server that states no limit.
constexpr std::size_t kDefaultPart = 10'000;

template <typename From, typename To>
void AppendAll(const From& from, std::vector<To>& to) {
  for (const auto& value : from) to.push_back(static_cast<To>(value));
}

// Appends one part's answers; `begin` is the index of its first point.
void Append(v1::QueryObstaclesResponse& response, std::size_t begin,
            PointAnswers& answers) {
  AppendAll(response.probability(), answers.probability);
  AppendAll(response.state(), answers.state);
  AppendAll(response.mean_depth_m(), answers.mean_depth_m);
  AppendAll(response.std_m(), answers.std_m);
  AppendAll(response.age_s(), answers.age_s);
  AppendAll(response.hazard_m(), answers.hazard_m);
  AppendAll(response.kind(), answers.kind);
  // A server may leave reasons out, and hazards where there are none.
  const std::size_t size = answers.state.size();
  answers.mean_depth_m.resize(size, std::nanf(""));
  answers.std_m.resize(size, std::nanf(""));
  answers.age_s.resize(size, std::nanf(""));
  answers.hazard_m.resize(size, std::nanf(""));
  answers.kind.resize(size, v1::EVIDENCE_KIND_UNSPECIFIED);
  for (v1::PointContact& contact : *response.mutable_contacts()) {
    contact.set_point_index(contact.point_index() +
                            static_cast<std::uint32_t>(begin));
    answers.contacts.push_back(std::move(contact));
  }
}

}  // namespace

absl::StatusOr<PointAnswers> AskPoints(const Client& client,
                                       const v1::QueryObstaclesRequest& common,
                                       const std::vector<QuestionPoint>& points,
                                       std::optional<Time> time) {
  PointAnswers answers;
  if (points.empty()) return answers;
  FATHOM_ASSIGN_OR_RETURN(const v1::GetMissionStatusResponse status,
                          client.GetMissionStatus());
  const auto limit =
      static_cast<std::size_t>(status.limits().max_points_per_query());
  const std::size_t part = limit > 0 ? limit : kDefaultPart;
  const bool own_times = std::any_of(
      points.begin(), points.end(),
      [](const QuestionPoint& point) { return point.time.has_value(); });
  // Offsets need a base; without one of the user's it is this machine's now.
  std::optional<Time> base = time;
  if (own_times && !base.has_value()) {
    base = std::chrono::time_point_cast<Duration>(
        std::chrono::system_clock::now());
  }
  v1::QueryObstaclesRequest request = common;
  if (base.has_value()) *request.mutable_time() = ToProto(*base);
  for (std::size_t begin = 0; begin < points.size(); begin += part) {
    const std::size_t end = std::min(points.size(), begin + part);
    request.clear_latitude_deg();
    request.clear_longitude_deg();
    request.clear_depth_m();
    request.clear_time_offset_us();
    for (std::size_t i = begin; i < end; ++i) {
      request.add_latitude_deg(points[i].latitude_deg);
      request.add_longitude_deg(points[i].longitude_deg);
      request.add_depth_m(static_cast<float>(points[i].depth_m));
      if (own_times) {
        request.add_time_offset_us(
            (points[i].time.value_or(*base) - *base).count());
      }
    }
    FATHOM_ASSIGN_OR_RETURN(v1::QueryObstaclesResponse response,
                            client.QueryObstacles(request));
    if (static_cast<std::size_t>(response.state_size()) != end - begin ||
        response.probability_size() != response.state_size()) {
      return absl::InternalError(
          absl::StrFormat("%d answers came for %d questions",
                          response.state_size(), end - begin));
    }
    Append(response, begin, answers);
    if (begin == 0) answers.stamp = response.stamp();
    request.set_min_revision(
        std::max(request.min_revision(), response.stamp().map_revision()));
  }
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (answers.kind[i] != v1::EVIDENCE_KIND_LAND) continue;
    answers.mean_depth_m[i] = std::nanf("");
    answers.std_m[i] = std::nanf("");
  }
  return answers;
}

}  // namespace fathom::client
