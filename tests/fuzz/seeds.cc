// Writes the seeds of every target: well-formed inputs for it to spoil.
//
//   fuzz_seeds FOLDER       FOLDER/<target>/seed-<name>; run it when a format
//                           or a message has changed, and commit what it wrote

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <vector>

#include "client/spool.h"
#include "storage/activity_codec.h"
#include "storage/blob.h"
#include "storage/contact_codec.h"
#include "storage/history_codec.h"
#include "storage/journal_codec.h"
#include "storage/restore.h"
#include "storage/tile_codec.h"
#include "tests/fuzz/requests.h"
#include "tests/server/sample_messages.h"
#include "tests/storage/event_script.h"
#include "tests/storage/temp_dir.h"

namespace fathom::fuzz {
namespace {

using storage::Bytes;

class Seeds {
 public:
  explicit Seeds(std::filesystem::path folder) : folder_(std::move(folder)) {}

  // `prefix` chooses the kind; none for a target with one.
  void Write(const std::string& target, const std::string& name, int prefix,
             const void* bytes, std::size_t size) {
    std::filesystem::create_directories(folder_ / target);
    std::ofstream out(folder_ / target / ("seed-" + name), std::ios::binary);
    if (prefix >= 0) out.put(static_cast<char>(prefix));
    out.write(static_cast<const char*>(bytes),
              static_cast<std::streamsize>(size));
  }
  // Without its envelope.
  void WriteBlob(const std::string& target, const std::string& name, int prefix,
                 const Bytes& blob) {
    Write(target, name, prefix, blob.data() + storage::kBlobHeaderBytes,
          blob.size() - storage::kBlobHeaderBytes);
  }
  template <typename Message>
  void WriteRequest(const std::string& name, Request kind,
                    const Message& message) {
    const std::string bytes = message.SerializeAsString();
    Write("requests", name, static_cast<int>(kind), bytes.data(), bytes.size());
  }

 private:
  std::filesystem::path folder_;
};

void WriteStorageSeeds(Seeds& seeds) {
  map::ObstacleMap map(*storage::OptionsOf(storage::SampleMetadata()));
  storage::EventScript script(map, map.View());
  storage::Batch first;
  // Into the second activity: tiles and blocks.
  for (int i = 0; i < 110; ++i) {
    script.Step();
    if (i == 12) first = script.batch();
  }
  const auto segments = storage::EncodeJournal(first.journal);
  for (const storage::JournalSegment& segment : *segments) {
    seeds.WriteBlob("journal", "script", -1, segment.content);
  }
  const auto view = map.View();
  int tiles = 0;
  view->global().ForEachTile([&](const map::Tile& tile) {
    seeds.WriteBlob("tiles", "tile-" + std::to_string(tiles++), 0,
                    storage::EncodeTile(tile.key(), tile.Content()));
  });
  int blocks = 0;
  const map::LocalMapView nothing;
  map::DiffBlocks(
      nothing, *view->activities().back()->local,
      [&](map::BlockIndex index, const map::LocalBlock& block) {
        if (blocks >= 3) return;
        const storage::BlockKey key{.activity_number = 2, .index = index};
        seeds.WriteBlob("tiles", "block-" + std::to_string(blocks++), 1,
                        storage::EncodeBlock(key, block));
      });
  // Seeds of the rows of formats 5 and 6 were written by their programs.
  const std::vector<map::ContactKey> names = {
      {.source = {"ais"}, .contact = {"235000001"}}};
  std::vector<storage::ContactHistoryRow> rows(3);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    static_cast<map::ContactPoint&>(rows[i].estimate) =
        storage::SampleContactPoint(static_cast<int>(i));
    rows[i].revision = i;
  }
  rows[1].estimate.linked = rows[2].estimate.linked = names;
  seeds.WriteBlob("contacts", "history", 6, storage::EncodeHistory(1, rows));
  map::DiffContacts(
      map::ContactsView(), view->contacts(),
      [&](const map::Contact& contact) {
        const Bytes blob = storage::EncodeContact(contact.ToStored());
        // Version 1 is read too.
        seeds.WriteBlob("contacts", "contact", 2, blob);
        seeds.WriteBlob("contacts", "contact-v1", 1, blob);
        map::StoredContact linked = contact.ToStored();
        linked.links = map::ContactLinks{.since = {}, .names = names};
        seeds.WriteBlob("contacts", "linked-contact", 5,
                        storage::EncodeContact(linked));
        // The first of its estimates as older ones.
        map::StoredContact older = linked;
        older.older.assign(older.estimates.begin(),
                           older.estimates.begin() + 1);
        seeds.WriteBlob("contacts", "older-contact", 7,
                        storage::EncodeContact(older));
      },
      [](const map::ContactKey&) {});
  map::StoredActivity activity;
  activity.start = storage::SampleStart("leg-1");
  activity.open = true;
  seeds.WriteBlob("contacts", "activity", 3, storage::EncodeActivity(activity));
  // Edits of the header, of a table's page, with and without checksums.
  const std::uint8_t edits[] = {0, 16, 0, 0, 1, 64, 32, 0, 255, 7, 100, 0, 3};
  seeds.Write("pages", "damaged", 0, edits, sizeof edits - 1);
  seeds.Write("pages", "sealed", 1, edits + 4, 8);
}

// One file and its successor, with marks and with a torn end.
void WriteSpoolSeeds(Seeds& seeds) {
  const storage::TempDir folder;
  const auto file = [&folder](const char* number) {
    std::ifstream in(folder.File("pings-0000000000000000000" +
                                 std::string(number) + ".spool"),
                     std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(in), {});
  };
  auto spool = *client::Spool::Open({.folder = folder.path().string(),
                                     .kind = "pings",
                                     .source_id = "uuv-1",
                                     .max_bytes = client::kLeastSpoolBytes});
  for (const char* text : {"a", "bb", "ccc"}) {
    (void)spool->Append(text);
    (void)spool->Sync();
  }
  (void)spool->Append("unsynced");
  const std::string first = file("1");
  (void)spool->Release(4);
  (void)spool->Clear();
  (void)spool->Append("e");
  const std::string second = file("5");
  const auto write = [&seeds](const std::string& name, int flags,
                              std::size_t first_size, const std::string& both) {
    const std::string input = {static_cast<char>(first_size & 0xFF),
                               static_cast<char>(first_size >> 8)};
    seeds.Write("spool", name, flags, (input + both).data(), 2 + both.size());
  };
  write("two", 3, first.size(), first + second);
  write("one", 7, 0, first);
  write("torn", 5, 0, first.substr(0, first.size() - 3));
}

v1::Trajectory SampleTrajectory() {
  v1::Trajectory trajectory;
  for (int i = 0; i < 3; ++i) {
    v1::Waypoint* waypoint = trajectory.add_waypoints();
    server::SetPoint(41.501 + 0.001 * i, -71.399, waypoint->mutable_position());
    waypoint->set_depth_m(15);
    waypoint->mutable_time()->set_seconds(server::kSampleSeconds + 100 * i);
  }
  trajectory.set_radius_m(5);
  trajectory.set_confidence(0.95);
  return trajectory;
}

void WriteRequestSeeds(Seeds& seeds) {
  seeds.WriteRequest("ping", Request::kPing, server::SamplePing());
  seeds.WriteRequest("fix", Request::kContactReport, server::SampleFix());
  seeds.WriteRequest("range-bearing", Request::kContactReport,
                     server::SampleRangeBearing());
  v1::ReportContactsRequest reports;
  *reports.add_reports() = server::SampleFix();
  *reports.add_reports() = server::SampleRangeBearing();
  seeds.WriteRequest("reports", Request::kReportContacts, reports);
  seeds.WriteRequest("start", Request::kStartActivity, server::SampleStart());
  v1::DropContactRequest drop;
  drop.set_source_id("ais");
  drop.set_contact_id("MMSI:367000001");
  seeds.WriteRequest("drop", Request::kDropContact, drop);
  v1::PriorHeader header;
  header.set_name("chart");
  seeds.WriteRequest("header", Request::kPriorHeader, header);
  seeds.WriteRequest("tile", Request::kDepthTile, server::SampleTile());
  seeds.WriteRequest("query", Request::kQueryObstacle, server::SampleQuery());
  seeds.WriteRequest("batch", Request::kQueryObstacles, server::SampleBatch());
  v1::CheckTrajectoryRequest check;
  *check.mutable_trajectory() = SampleTrajectory();
  seeds.WriteRequest("trajectory", Request::kCheckTrajectory, check);
  v1::FindNearestObstacleRequest nearest;
  server::SetPoint(41.505, -71.395, nearest.mutable_position());
  nearest.set_depth_m(25);
  nearest.set_confidence(0.95);
  nearest.set_search_radius_m(500);
  seeds.WriteRequest("nearest", Request::kFindNearestObstacle, nearest);
  v1::GetRegionRequest region;
  server::SetPoint(41.501, -71.399, region.mutable_south_west());
  server::SetPoint(41.503, -71.397, region.mutable_north_east());
  region.set_resolution_m(20);
  seeds.WriteRequest("region", Request::kGetRegion, region);
  v1::WatchRegionRequest watch_region;
  *watch_region.mutable_region() = region;
  seeds.WriteRequest("watch-region", Request::kWatchRegion, watch_region);
  v1::WatchContactsRequest watch_contacts;
  watch_contacts.set_from_revision(1);
  watch_contacts.set_run_id(kFuzzRun);
  watch_contacts.set_batched(true);
  seeds.WriteRequest("watch-contacts", Request::kWatchContacts, watch_contacts);
  v1::WatchTrajectoryRequest watch_trajectory;
  *watch_trajectory.mutable_trajectory() = SampleTrajectory();
  watch_trajectory.set_hysteresis(0.1);
  watch_trajectory.set_alert_stands(true);
  seeds.WriteRequest("watch-trajectory", Request::kWatchTrajectory,
                     watch_trajectory);
}

}  // namespace
}  // namespace fathom::fuzz

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fputs("usage: fuzz_seeds FOLDER\n", stderr);
    return 2;
  }
  fathom::fuzz::Seeds seeds(argv[1]);
  fathom::fuzz::WriteStorageSeeds(seeds);
  fathom::fuzz::WriteRequestSeeds(seeds);
  fathom::fuzz::WriteSpoolSeeds(seeds);
  return 0;
}
