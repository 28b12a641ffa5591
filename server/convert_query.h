// Questions from the wire and answers to it. The hot path: an accepted
// question allocates nothing beyond what its answer needs.
//
// Pure functions; thread-safe.

#ifndef FATHOM_SERVER_CONVERT_QUERY_H_
#define FATHOM_SERVER_CONVERT_QUERY_H_

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "base/time.h"
#include "fathom/v1/obstacle_service.pb.h"
#include "map/obstacle_map/obstacle_map_view.h"
#include "map/query/obstacle_query.h"
#include "server/workers.h"

namespace fathom::server {

// One question; depth below the mission's datum; `now` where time is absent.
absl::StatusOr<map::ObstacleQuery> ConvertQuery(
    const v1::QueryObstacleRequest& request, Time now);

// One answer.
void WriteAnswer(const map::ObstacleAnswer& answer, v1::ObstacleAnswer* out);

// Checks the whole batch, then answers every point of it from `view`; without
// reasons also on those of `helpers` that are free. On an
// error `out` is unspecified. Errors: INVALID_ARGUMENT (field path, with the
// index of the point), RESOURCE_EXHAUSTED past kMaxPointsPerQuery; CANCELLED
// soon after `unwanted` is true, which is asked now and then, by several
// threads at once.
absl::Status AnswerBatch(
    const v1::QueryObstaclesRequest& request, Time now,
    const map::ObstacleMapView& view, v1::QueryObstaclesResponse* out,
    absl::FunctionRef<bool()> unwanted = [] { return false; },
    Workers* helpers = nullptr);
// The checks alone, for a request that has to wait for a revision.
absl::Status CheckBatch(const v1::QueryObstaclesRequest& request);

// What ListContacts answers.
void ListContacts(const map::ObstacleMapView& view, Time time,
                  bool include_inactive, v1::ListContactsResponse* out);

}  // namespace fathom::server

#endif  // FATHOM_SERVER_CONVERT_QUERY_H_
