// The scene that the RPC bench measures on: a chart, a surveyed activity and
// the questions and pings that go with it.
#ifndef FATHOM_TESTS_BENCH_RPC_BENCH_RPC_SCENE_H_
#define FATHOM_TESTS_BENCH_RPC_BENCH_RPC_SCENE_H_

#include <random>

#include "absl/status/status.h"
#include "client/client.h"

namespace fathom::bench {

// South-west corner of the surveyed area, 1 km x 1 km.
inline constexpr double kLatitudeDeg = 41.50;
inline constexpr double kLongitudeDeg = -71.40;
inline constexpr int kBeams = 101;

// Loads a chart, opens the activity "bench" (10 m cells) and surveys it with
// `pings` pings, durable when it returns.
absl::Status PrepareScene(const client::Client& server, int pings);

// The next ping of a vehicle that criss-crosses the area: 101 beams.
void FillPing(std::mt19937_64& random, v1::Ping& ping);

// A report about vessel `contact`: heard from the area at 2 to 12 km, 20 m and
// 1 degree.
void FillReport(std::mt19937_64& random, int contact,
                v1::ContactReport& report);

// A question at a random place in the area.
void FillQuery(std::mt19937_64& random, v1::QueryObstacleRequest& query);

// `points` questions in one message.
void FillBatch(std::mt19937_64& random, int points,
               v1::QueryObstaclesRequest& batch);

// The same many questions about the way ahead of point `chosen` of `batch`, in
// an arc of 20 m; back in the middle where the area ends.
void MoveBatch(std::mt19937_64& random, int chosen,
               v1::QueryObstaclesRequest& batch);

}  // namespace fathom::bench

#endif  // FATHOM_TESTS_BENCH_RPC_BENCH_RPC_SCENE_H_
