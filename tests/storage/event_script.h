// A deterministic stream of events for one mission: event i is the same in
// every process, so that a test can rebuild the map that any prefix of the
// stream must give and compare digests.

#ifndef FATHOM_TESTS_STORAGE_EVENT_SCRIPT_H_
#define FATHOM_TESTS_STORAGE_EVENT_SCRIPT_H_

#include <cstdint>
#include <cstdlib>
#include <memory>
#include <random>
#include <string>
#include <utility>

#include "absl/strings/str_format.h"
#include "storage/history_replay.h"
#include "storage/restore.h"
#include "tests/storage/sample_records.h"

namespace fathom::storage {

// Plays the script on a map and collects what has to be committed.
class EventScript {
 public:
  // Starts behind `map`'s revision: event i takes the map to revision i.
  EventScript(map::ObstacleMap& map,
              std::shared_ptr<const map::ObstacleMapView> checkpoint)
      : map_(map), checkpoint_(std::move(checkpoint)) {}

  // Applies the next event and adds it to the batch. Every 40th is a transfer,
  // which is not journalled but makes a checkpoint of the batch.
  void Step() {
    const std::uint64_t i = map_.revision() + 1;
    std::mt19937 random(static_cast<unsigned>(i));
    const std::string activity =
        absl::StrFormat("survey-%d", (i - 1) / kActivityEvents);
    if ((i - 1) % kActivityEvents == 0) {
      const map::StartActivity start = SampleStart(activity);
      Require(map_.Start(start).ok());
      batch_.journal.push_back({i, start});
    } else if (i % kActivityEvents == 0) {
      Require(map_.Complete({activity}, false).ok());
      Checkpointed();
    } else if (i % 40 == 0) {
      Require(map_.Transfer({activity}).ok());
      Checkpointed();
    } else if (i % 5 == 0) {
      ApplyReport(i);
    } else {
      PingRecord ping{
          .source = {"sonar"},
          .epoch = 1,
          .sequence = i,
          .ping = SamplePing(random, activity, static_cast<int>(i % 1000))};
      Require(map_.ApplyPing(ping.ping).ok());
      batch_.journal.push_back({i, std::move(ping)});
    }
    Require(map_.revision() == i);
  }

  // Makes the batch carry a checkpoint of the map as it is.
  void Checkpointed() {
    batch_.checkpoint = Checkpoint{.now = map_.View(), .previous = checkpoint_};
  }

  const Batch& batch() const { return batch_; }

  // The batch was committed: begins the next.
  void Committed() {
    if (batch_.checkpoint.has_value()) checkpoint_ = batch_.checkpoint->now;
    batch_ = Batch();
  }

 private:
  static constexpr std::uint64_t kActivityEvents = 100;

  static void Require(bool holds) {
    if (!holds) std::abort();
  }

  void ApplyReport(std::uint64_t i) {
    ContactRecord record{.epoch = 1,
                         .sequence = i,
                         .report = SampleReport(static_cast<int>(i),
                                                i % 2 == 0 ? "even" : "odd")};
    map::ContactOutcome outcome = map_.ApplyContact(record.report);
    Require(outcome.applied);
    AppendHistoryRows(std::move(outcome), i, batch_.contact_history);
    batch_.journal.push_back({i, std::move(record)});
  }

  map::ObstacleMap& map_;
  std::shared_ptr<const map::ObstacleMapView> checkpoint_;
  Batch batch_;
};

// The digest of the map after `revision` events.
inline std::string ScriptDigest(const map::MissionOptions& options,
                                std::uint64_t revision) {
  map::ObstacleMap map(options);
  EventScript script(map, nullptr);
  while (map.revision() < revision) {
    script.Step();
    script.Committed();
  }
  return map.View()->Digest();
}

}  // namespace fathom::storage

#endif  // FATHOM_TESTS_STORAGE_EVENT_SCRIPT_H_
