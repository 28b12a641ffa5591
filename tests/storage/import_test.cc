// Merging one mission's map into another (storage/offline.h).

#include <gtest/gtest.h>

#include <filesystem>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "storage/mission_file.h"
#include "storage/offline.h"
#include "storage/restore.h"
#include "tests/storage/sample_records.h"
#include "tests/storage/temp_dir.h"
#include "tests/testing/status_matchers.h"

namespace fathom::storage {
namespace {

using ::fathom::testing::IsOk;
using ::fathom::testing::StatusIs;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

using Leaves = std::vector<std::pair<map::CellKey, map::Leaf>>;

Leaves KnownLeaves(const map::ObstacleMapView& view) {
  Leaves leaves;
  view.global().ForEachLeaf(
      [&](const map::CellKey& cell, const map::Leaf& leaf) {
        if (leaf.known()) leaves.emplace_back(cell, leaf);
      });
  return leaves;
}

// Hardly any leaf within the tolerance of another: none is joined.
MissionMetadata Metadata(const std::string& id) {
  MissionMetadata metadata = SampleMetadata();
  metadata.mission_id = id;
  metadata.tolerance_m = 1e-6;
  return metadata;
}

class ImportMission : public ::testing::Test {
 protected:
  // One survey, `shift_m` metres further north than that of SampleStart; pings
  // drawn from `seed`.
  static void Survey(map::ObstacleMap& map, const std::string& activity,
                     double shift_m, unsigned seed,
                     std::vector<JournalRecord>* journal = nullptr) {
    map::StartActivity start = SampleStart(activity);
    start.options.south_west.latitude_deg += shift_m / 111'000;
    ASSERT_THAT(map.Start(start), IsOk());
    if (journal) journal->push_back({map.revision(), start});
    std::mt19937 random(seed);
    for (int i = 0; i < 30; ++i) {
      PingRecord record{.source = {"sonar-" + activity},
                        .epoch = 1,
                        .sequence = static_cast<std::uint64_t>(i + 1),
                        .ping = SamplePing(random, activity, i)};
      record.ping.pose.position.latitude_deg += shift_m / 111'000;
      record.ping.pose.heading_deg = 12 * i;
      ASSERT_THAT(map.ApplyPing(record.ping), IsOk());
      if (journal) journal->push_back({map.revision(), std::move(record)});
    }
  }

  // A mission with one survey: in its journal, or transferred.
  void Make(const std::string& name, const MissionMetadata& metadata,
            double shift_m, unsigned seed, bool completed) {
    FATHOM_ASSERT_OK_AND_ASSIGN(const auto file,
                                MissionFile::Create(dir_.File(name), metadata));
    map::ObstacleMap map(*OptionsOf(metadata));
    Batch batch;
    Survey(map, name, shift_m, seed, &batch.journal);
    if (completed) {
      ASSERT_THAT(map.Complete({name}, false), IsOk());
      batch.journal.clear();
      batch.checkpoint = Checkpoint{.now = map.View(), .previous = nullptr};
    }
    ASSERT_THAT(file->Commit(batch), IsOk());
    ASSERT_THAT(file->Close(), IsOk());
  }

  std::shared_ptr<const map::ObstacleMapView> Read(const std::string& name) {
    const auto file = MissionFile::Open(dir_.File(name));
    EXPECT_THAT(file, IsOk());
    absl::StatusOr<Loaded> loaded = (*file)->Load();
    EXPECT_THAT(loaded, IsOk());
    const map::MissionOptions options = *OptionsOf(loaded->metadata);
    return RestoreMap(*std::move(loaded), options)->map->View();
  }

  absl::StatusOr<Import> Merge(const std::string& from, const std::string& into,
                               ImportOptions options = {}) {
    options.now = TimeFromUnixMicros(1'000'000'900'000'000);
    return storage::ImportMission(dir_.File(from), dir_.File(into), options);
  }

  const TempDir dir_;
};

TEST_F(ImportMission, TheMergedMapEqualsOneMissionThatSurveyedBoth) {
  Make("a", Metadata("id-a"), 0, 1, /*completed=*/true);
  Make("b", Metadata("id-b"), 40, 2, /*completed=*/false);
  map::ObstacleMap both(*OptionsOf(Metadata("both")));
  Survey(both, "a", 0, 1);
  ASSERT_THAT(both.Complete({"a"}, false), IsOk());
  Survey(both, "b", 40, 2);
  ASSERT_THAT(both.Complete({"b"}, false), IsOk());
  const std::string b_before = Read("b")->Digest();
  const std::string a_before = Read("a")->Digest();

  FATHOM_ASSERT_OK_AND_ASSIGN(const Import import, Merge("b", "a"));
  EXPECT_GT(import.merge.leaves_written, 200u);
  EXPECT_EQ(import.merge.leaves_kept, 0u);
  EXPECT_THAT(import.left_out, IsEmpty());
  const auto merged = Read("a");
  EXPECT_EQ(merged->Digest(), import.digest);
  EXPECT_EQ(merged->revision(), import.revision);
  const Leaves expected = KnownLeaves(*both.View());
  ASSERT_GT(expected.size(), import.merge.leaves_before);
  EXPECT_EQ(KnownLeaves(*merged), expected);
  EXPECT_EQ(merged->as_of(), both.View()->as_of());
  // The other mission is as it was, and so is what was put aside of this one.
  EXPECT_EQ(Read("b")->Digest(), b_before);
  EXPECT_EQ(import.backup, dir_.File("a.r32.bak"));
  EXPECT_EQ(Read("a.r32.bak")->Digest(), a_before);
}

TEST_F(ImportMission, EvidenceNeverCountsTwice) {
  Make("a", Metadata("id-a"), 0, 1, true);
  Make("b", Metadata("id-b"), 40, 2, true);
  Make("c", Metadata("id-c"), 80, 3, true);
  std::filesystem::copy_file(dir_.File("a"), dir_.File("copy-of-a"));
  EXPECT_THAT(Merge("copy-of-a", "a"),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       HasSubstr("would count twice")));
  ASSERT_THAT(Merge("b", "a"), IsOk());
  const std::string digest = Read("a")->Digest();
  EXPECT_THAT(Merge("b", "a"), StatusIs(absl::StatusCode::kAlreadyExists,
                                        HasSubstr("mission_id=id-b")));
  // b came into c by a; a holds c now.
  ASSERT_THAT(Merge("a", "c"), IsOk());
  EXPECT_THAT(Merge("b", "c"), StatusIs(absl::StatusCode::kAlreadyExists,
                                        HasSubstr("mission_id=id-b")));
  EXPECT_THAT(Merge("c", "a"), StatusIs(absl::StatusCode::kFailedPrecondition));
  EXPECT_EQ(Read("a")->Digest(), digest);
  // As a chart it may, and says nothing new.
  const Leaves before = KnownLeaves(*Read("a"));
  ASSERT_THAT(Merge("b", "a", {.ageing_m2_s = {}, .as_chart = true}), IsOk());
  EXPECT_EQ(KnownLeaves(*Read("a")), before);
}

TEST_F(ImportMission, ANewMissionStartsFromASavedMap) {
  Make("saved", Metadata("id-saved"), 0, 1, true);
  ImportOptions options;
  options.create = "id-new";
  FATHOM_ASSERT_OK_AND_ASSIGN(const Import import,
                              Merge("saved", "new", options));
  EXPECT_THAT(import.backup, IsEmpty());
  EXPECT_EQ(KnownLeaves(*Read("new")), KnownLeaves(*Read("saved")));
  EXPECT_THAT(Read("new")->activities(), IsEmpty());
  FATHOM_ASSERT_OK_AND_ASSIGN(const MissionInfo info,
                              ReadInfo(dir_.File("new")));
  EXPECT_EQ(info.metadata.mission_id, "id-new");
  EXPECT_EQ(info.metadata.vertical_datum, "MLLW");
  EXPECT_THAT(Merge("saved", "new", options),
              StatusIs(absl::StatusCode::kAlreadyExists));
}

TEST_F(ImportMission, AgeingIsThatWhichTheAnswersDoNotAddThemselves) {
  MissionMetadata from = Metadata("id-from");
  from.ageing_rate_m2_s = 3e-5;
  MissionMetadata into = Metadata("id-into");
  into.ageing_rate_m2_s = 1e-5;
  Make("from", from, 0, 1, true);
  Make("into", into, 5000, 2, true);
  ASSERT_THAT(Merge("from", "into"), IsOk());
  const Leaves before = KnownLeaves(*Read("from"));
  const auto merged = Read("into");
  ASSERT_GT(before.size(), 100u);
  for (const auto& [cell, leaf] : before) {
    const auto found =
        merged->global().LeafAt(merged->global().root().Center(cell));
    ASSERT_EQ(found->first, cell);
    // (3e-5 - 1e-5) m^2/s since the leaf's time, up to 1'000'000'900 s.
    const double added_m2 = 2e-5 * (1'000'000'900.0 - leaf.time_s);
    const double expected_m =
        std::sqrt(leaf.mean_std_m() * leaf.mean_std_m() + added_m2);
    EXPECT_NEAR(found->second.mean_std_m(), expected_m, 0.002 * expected_m);
    EXPECT_EQ(found->second.time_s, leaf.time_s);
  }
}

TEST_F(ImportMission, WhatDoesNotFitIsRefusedAndNothingChanges) {
  MissionMetadata other_datum = Metadata("id-b");
  other_datum.vertical_datum = "MSL";
  Make("b", other_datum, 0, 2, true);
  MissionMetadata small = Metadata("id-a");
  Make("probe", small, 0, 1, true);
  small.max_cells = Read("probe")->global().leaf_count() + 100;
  Make("a", small, 0, 1, true);
  Make("c", Metadata("id-c"), 300, 3, true);
  const std::string digest = Read("a")->Digest();
  EXPECT_THAT(Merge("b", "a"), StatusIs(absl::StatusCode::kFailedPrecondition,
                                        AllOf(HasSubstr("vertical_datum=MSL"),
                                              HasSubstr("MLLW"))));
  EXPECT_THAT(Merge("c", "a"), StatusIs(absl::StatusCode::kResourceExhausted,
                                        HasSubstr("max_cells=")));
  EXPECT_THAT(Merge("c", "a", {.ageing_m2_s = -1.0}),
              StatusIs(absl::StatusCode::kInvalidArgument));
  EXPECT_THAT(Merge("c", "c"), StatusIs(absl::StatusCode::kFailedPrecondition));
  EXPECT_THAT(Merge("none", "a"), StatusIs(absl::StatusCode::kNotFound));
  EXPECT_THAT(Merge("a", "none"), StatusIs(absl::StatusCode::kNotFound));
  EXPECT_EQ(Read("a")->Digest(), digest);
  // A refused creation leaves nothing behind.
  ImportOptions options;
  options.create = "";  // No mission_id.
  EXPECT_THAT(Merge("c", "new", options),
              StatusIs(absl::StatusCode::kInvalidArgument));
  EXPECT_FALSE(std::filesystem::exists(dir_.File("new")));
}

}  // namespace
}  // namespace fathom::storage
