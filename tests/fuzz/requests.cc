// Fuzz target: every request from its bytes through its converter into the
// map, as the services do it: what a converter lets through must not hurt.

#include "tests/fuzz/requests.h"

#include <atomic>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <variant>

#include "map/obstacle_map/check_trajectory.h"
#include "map/obstacle_map/find_nearest.h"
#include "server/change_log.h"
#include "server/convert_ingest.h"
#include "server/convert_mission.h"
#include "server/convert_query.h"
#include "server/convert_trajectory.h"
#include "server/region.h"
#include "server/watch_contacts.h"
#include "server/watch_region.h"
#include "server/watch_trajectory.h"
#include "tests/fuzz/fuzz.h"
#include "tests/server/sample_map.h"
#include "tests/server/sample_messages.h"
#include "tests/testing/fake_clock.h"

namespace fathom::fuzz {
namespace {

using server::FieldPath;

constexpr Time kNow = Time(std::chrono::seconds(server::kSampleSeconds + 60));

// Work that a question may take: enough for every branch, too little to wait.
constexpr std::uint64_t kMostCells = 2000;

// Most cells of an area or a region that is really opened.
constexpr std::uint64_t kMostAreaCells = 10'000;

// A map with a chart and an open activity.
map::ObstacleMap NewMap() {
  map::MissionOptions options = server::SampleOptions();
  options.max_local_cells = 10'000;
  map::ObstacleMap map(options);
  FATHOM_FUZZ_CHECK(map.Import(server::SampleChart(), true).ok());
  const auto start = server::ConvertStart(server::SampleStart(), kNow);
  FATHOM_FUZZ_CHECK(start.ok() && map.Start(*start).ok());
  return map;
}

// The map that takes what is let through; begun anew now and then, so that an
// input can be found again and memory stays bounded.
map::ObstacleMap& Writable() {
  static std::unique_ptr<map::ObstacleMap> map;
  static int uses = 0;
  if (uses++ % 256 == 0) map = std::make_unique<map::ObstacleMap>(NewMap());
  return *map;
}

const map::ObstacleMapView& View() {
  static const std::shared_ptr<const map::ObstacleMapView> view = [] {
    map::ObstacleMap map = NewMap();
    const auto ping = server::ConvertPing(server::SamplePing(), FieldPath());
    FATHOM_FUZZ_CHECK(ping.ok() && map.ApplyPing(*ping).ok());
    const auto report = server::ConvertReport(server::SampleFix(), FieldPath());
    FATHOM_FUZZ_CHECK(report.ok() && map.ApplyContact(*report).applied);
    return map.View();
  }();
  return *view;
}

// Every answer is a probability.
void CheckAnswer(const map::ObstacleAnswer& answer) {
  if (answer.state == map::ObstacleState::kUnknown) return;
  FATHOM_FUZZ_CHECK(answer.probability >= 0 && answer.probability <= 1);
}

void Take(const server::IngestMessage& message) {
  if (const auto* ping = std::get_if<map::Ping>(&message.content)) {
    (void)Writable().ApplyPing(*ping);
  } else if (const auto* report =
                 std::get_if<map::ContactReport>(&message.content)) {
    const map::ContactOutcome outcome = Writable().ApplyContact(*report);
    if (outcome.applied && outcome.estimate.has_value()) {
      FATHOM_FUZZ_CHECK(outcome.estimate->x.allFinite());
      FATHOM_FUZZ_CHECK(outcome.estimate->P.allFinite());
    }
  }
}

void Fuzz(const v1::Ping& ping) {
  Take(server::NotFromTheFuture(server::ToIngest(ping, FieldPath()), kNow,
                                FieldPath()));
}

void Fuzz(const v1::ContactReport& report) {
  Take(server::NotFromTheFuture(server::ToIngest(report, FieldPath()), kNow,
                                FieldPath()));
}

void Fuzz(const v1::ReportContactsRequest& request) {
  const auto messages = server::ConvertReports(request, kNow);
  if (!messages.ok()) return;
  for (const server::IngestMessage& message : *messages) Take(message);
}

void Fuzz(const v1::StartActivityRequest& request) {
  const auto start = server::ConvertStart(request, kNow);
  if (!start.ok()) return;
  map::ObstacleMap map = NewMap();
  if (!map.Start(*start).ok()) return;
  auto ping = server::ConvertPing(server::SamplePing(), FieldPath());
  ping->activity = start->id;
  (void)map.ApplyPing(*ping);
  (void)map.Complete(start->id, false);
}

void Fuzz(const v1::DropContactRequest& request) {
  const auto drop = server::ConvertDrop(request, kNow);
  if (drop.ok()) (void)Writable().Drop(*drop);
}

void Fuzz(const v1::PriorHeader& header) {
  (void)server::ConvertHeader(header, FieldPath());
}

void Fuzz(const v1::DepthTile& tile) {
  const auto block = server::ConvertTile(tile, {.name = "chart"}, FieldPath());
  if (!block.ok()) return;
  // Cells as wide as a continent divide the map as far as max_cells lets them.
  map::MissionOptions options = server::SampleOptions();
  options.global.max_cells = 20'000;
  map::ObstacleMap map(options);
  (void)map.Import(*block, true);
}

void Fuzz(const v1::QueryObstacleRequest& request) {
  const auto query = server::ConvertQuery(request, kNow);
  if (!query.ok()) return;
  const map::ObstacleAnswer answer = View().Answer(*query);
  CheckAnswer(answer);
  v1::ObstacleAnswer out;
  server::WriteAnswer(answer, &out);
}

void Fuzz(const v1::QueryObstaclesRequest& request) {
  if (!server::CheckBatch(request).ok()) return;
  v1::QueryObstaclesResponse out;
  (void)server::AnswerBatch(request, kNow, View(), &out);
}

void Fuzz(const v1::CheckTrajectoryRequest& request) {
  const auto trajectory =
      server::ConvertTrajectory(request.trajectory(), FieldPath());
  if (!trajectory.ok()) return;
  const auto verdict = map::CheckTrajectory(
      View(), *trajectory,
      {.stop_at_first = request.stop_at_first(), .most_cells = kMostCells});
  if (!verdict.ok()) return;
  for (const map::LegVerdict& leg : verdict->legs) {
    FATHOM_FUZZ_CHECK(leg.worst_probability >= 0 && leg.worst_probability <= 1);
  }
  v1::CheckTrajectoryResponse out;
  server::WriteVerdict(*verdict, &out);
}

void Fuzz(const v1::FindNearestObstacleRequest& request) {
  const auto question = server::ConvertNearest(request, kNow);
  if (!question.ok()) return;
  const auto nearest =
      map::FindNearestObstacle(View(), *question, {.most_cells = kMostCells});
  if (!nearest.ok() || !nearest->has_value()) return;
  FATHOM_FUZZ_CHECK((*nearest)->distance_m >= 0);
  v1::FindNearestObstacleResponse out;
  server::WriteNearest(**nearest, &out);
}

void Fuzz(const v1::GetRegionRequest& request) {
  auto region = server::Region::Create(request, kNow);
  if (!region.ok()) return;
  if (std::uint64_t{region->rows()} * region->columns() > kMostAreaCells) {
    return;
  }
  static const auto view = std::make_shared<const map::ObstacleMapView>(View());
  if (!region->Open(view).ok()) return;
  const std::atomic<bool> stop{false};
  v1::GetRegionResponse out;
  while (region->Next(stop, &out) == server::Region::Step::kBlock) out.Clear();
}

// A log that is shown one change; each watch reads from before it.
const server::ChangeLog& Log() {
  static const std::unique_ptr<server::ChangeLog> log = [] {
    auto shown = std::make_unique<server::ChangeLog>(
        kFuzzRun, server::ChangeLogOptions());
    map::ObstacleMap map = NewMap();
    shown->Restart(map.View());
    const auto ping = server::ConvertPing(server::SamplePing(), FieldPath());
    FATHOM_FUZZ_CHECK(ping.ok() && map.ApplyPing(*ping).ok());
    const auto report = server::ConvertReport(server::SampleFix(), FieldPath());
    FATHOM_FUZZ_CHECK(report.ok() && map.ApplyContact(*report).applied);
    shown->Show(map.View());
    return shown;
  }();
  return *log;
}

// All that a watch has to tell now, or what a test has patience for.
template <typename Watch>
void Follow(Watch watch) {
  constexpr int kMostMessages = 20;
  const std::atomic<bool> stop{false};
  typename Watch::Response out;
  for (int i = 0; i < kMostMessages; ++i) {
    const auto step =
        watch.Next(server::SteadyTime(std::chrono::hours(1)), stop, &out);
    if (!step.ok() || *step != server::WatchStep::kMessage) return;
  }
}

void Fuzz(const v1::WatchRegionRequest& request) {
  static testing::FakeClock clock(kNow);
  auto watch = server::RegionWatch::Create(request, Log(), clock);
  if (watch.ok()) Follow(*std::move(watch));
}

void Fuzz(const v1::WatchContactsRequest& request) {
  Follow(server::ContactsWatch(request, Log()));
}

void Fuzz(const v1::WatchTrajectoryRequest& request) {
  auto watch = server::TrajectoryWatch::Create(request, Log(), kMostCells);
  if (watch.ok()) Follow(*std::move(watch));
}

template <typename Message>
void Parse(const std::uint8_t* bytes, std::size_t size) {
  Message message;
  if (message.ParseFromArray(bytes, static_cast<int>(size))) Fuzz(message);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes,
                                      std::size_t size) {
  if (size == 0) return 0;
  const std::uint8_t kind =
      bytes[0] % static_cast<std::uint8_t>(Request::kCount);
  ++bytes;
  --size;
  switch (static_cast<Request>(kind)) {
    case Request::kPing:
      Parse<v1::Ping>(bytes, size);
      break;
    case Request::kContactReport:
      Parse<v1::ContactReport>(bytes, size);
      break;
    case Request::kReportContacts:
      Parse<v1::ReportContactsRequest>(bytes, size);
      break;
    case Request::kStartActivity:
      Parse<v1::StartActivityRequest>(bytes, size);
      break;
    case Request::kDropContact:
      Parse<v1::DropContactRequest>(bytes, size);
      break;
    case Request::kPriorHeader:
      Parse<v1::PriorHeader>(bytes, size);
      break;
    case Request::kDepthTile:
      Parse<v1::DepthTile>(bytes, size);
      break;
    case Request::kQueryObstacle:
      Parse<v1::QueryObstacleRequest>(bytes, size);
      break;
    case Request::kQueryObstacles:
      Parse<v1::QueryObstaclesRequest>(bytes, size);
      break;
    case Request::kCheckTrajectory:
      Parse<v1::CheckTrajectoryRequest>(bytes, size);
      break;
    case Request::kFindNearestObstacle:
      Parse<v1::FindNearestObstacleRequest>(bytes, size);
      break;
    case Request::kGetRegion:
      Parse<v1::GetRegionRequest>(bytes, size);
      break;
    case Request::kWatchRegion:
      Parse<v1::WatchRegionRequest>(bytes, size);
      break;
    case Request::kWatchContacts:
      Parse<v1::WatchContactsRequest>(bytes, size);
      break;
    case Request::kWatchTrajectory:
      Parse<v1::WatchTrajectoryRequest>(bytes, size);
      break;
    case Request::kCount:
      break;
  }
  return 0;
}

}  // namespace fathom::fuzz
