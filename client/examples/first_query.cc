// Is there an obstacle ahead? The smallest program that asks.
//
//   first_query 127.0.0.1:7430 41.2 -71.4 20
//   FREE: P(obstacle) = 0.0002; seabed 34.1 m +- 4.0 m

#include <cstdio>
#include <cstdlib>
#include <string>

#include "client/client.h"

namespace v1 = fathom::v1;

int main(int argc, char** argv) {
  if (argc != 5) {
    std::fprintf(stderr, "usage: first_query SERVER LAT_DEG LON_DEG DEPTH_M\n");
    return 1;
  }
  // One client serves a whole program: it keeps one connection, and all its
  // methods may be called from any thread.
  const auto client = fathom::client::Client::Connect(argv[1], {});
  if (!client.ok()) {
    std::fprintf(stderr, "%s\n", client.status().ToString().c_str());
    return 1;
  }

  v1::QueryObstacleRequest request;
  request.mutable_position()->set_latitude_deg(std::atof(argv[2]));
  request.mutable_position()->set_longitude_deg(std::atof(argv[3]));
  request.set_depth_m(std::atof(argv[4]));
  request.set_confidence(0.95);
  const auto response = (*client)->QueryObstacle(request);
  if (!response.ok()) {  // The message names the field that was wrong.
    std::fprintf(stderr, "%s\n", response.status().ToString().c_str());
    return 1;
  }

  const v1::ObstacleAnswer& answer = response->answer();
  std::string state = v1::ObstacleState_Name(answer.state());
  state.erase(0, std::string("OBSTACLE_STATE_").size());
  std::printf("%s: P(obstacle) = %.4f", state.c_str(), answer.probability());
  if (answer.has_seabed()) {
    std::printf("; seabed %.1f m +- %.1f m", answer.seabed().depth_m(),
                answer.seabed().std_m());
  }
  std::printf("\n");
  return 0;
}
