// Pings of 101 beams through PingStream to the fake server of this process:
// both ends share the machine. Run by hand; no test depends on its figures.

#include <benchmark/benchmark.h>

#include "client/client.h"
#include "client/ping_stream.h"
#include "tests/client/fake_server.h"

namespace fathom::client {
namespace {

void BM_PingStream(benchmark::State& state) {
  FakeServer server;
  auto client = Client::Connect(server.address(), {});
  auto stream = (*client)->OpenPingStream({.source_id = "bench"});
  v1::Ping ping;
  ping.set_activity_id("survey");
  ping.mutable_pose()->mutable_position()->set_latitude_deg(41.5);
  ping.mutable_pose()->mutable_position()->set_longitude_deg(-71.4);
  for (int beam = 0; beam < 101; ++beam) {  // SeaBat 8101.
    ping.add_range_m(50.0f + static_cast<float>(beam));
    ping.add_bearing_deg(-75.0f + 1.5f * static_cast<float>(beam));
    ping.add_depth_m(20.5f);
    ping.add_std_m(0.25f);
  }
  for (auto _ : state) {
    if (!(*stream)->Send(ping).ok()) state.SkipWithError("send");
  }
  if (!(*stream)->Finish().ok()) state.SkipWithError("finish");
  state.SetItemsProcessed(state.iterations());
  state.SetBytesProcessed(state.iterations() *
                          static_cast<std::int64_t>(ping.ByteSizeLong()));
}
BENCHMARK(BM_PingStream)->UseRealTime()->Iterations(400'000);

}  // namespace
}  // namespace fathom::client
