// The contact history in a mission file against a list that is kept plainly.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "storage/history_codec.h"
#include "storage/history_replay.h"
#include "storage/mission_file.h"
#include "storage/offline.h"
#include "storage/restore.h"
#include "storage/sqlite.h"
#include "tests/storage/sample_records.h"
#include "tests/storage/temp_dir.h"
#include "tests/testing/status_matchers.h"

namespace fathom::storage {
namespace {

using ::fathom::testing::IsOk;
using ::fathom::testing::IsOkAndHolds;
using ::fathom::testing::StatusIs;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

// A mission, its map, and what its history must be.
class HistoryFileTest : public ::testing::Test {
 protected:
  using Kept = std::map<std::pair<Time, std::uint64_t>, map::ContactEstimate>;

  HistoryFileTest() {
    file_ = *MissionFile::Create(path(), SampleMetadata());
    map_ = std::make_unique<map::ObstacleMap>(*OptionsOf(SampleMetadata()));
    saved_ = map_->View();
  }

  std::string path() const { return dir_.File("m"); }

  void Report(const map::ContactReport& report) {
    map::ContactOutcome outcome = map_->ApplyContact(report);
    const std::size_t before = batch_.contact_history.size();
    AppendHistoryRows(std::move(outcome), map_->revision(),
                      batch_.contact_history);
    batch_.journal.push_back(
        {map_->revision(),
         ContactRecord{
             .epoch = 1, .sequence = map_->revision(), .report = report}});
    for (std::size_t i = before; i < batch_.contact_history.size(); ++i) {
      Keep(batch_.contact_history[i]);
    }
  }

  void Keep(const ContactHistoryRow& row) {
    Kept& kept = kept_[row.estimate.key];
    if (row.revises) {
      std::erase_if(kept, [&row](const auto& held) {
        return held.first.first >= row.estimate.time &&
               held.first.second < row.revision;
      });
    }
    kept[{row.estimate.time, row.revision}] = row.estimate;
  }

  void Commit(bool checkpoint) {
    if (checkpoint) {
      batch_.checkpoint = Checkpoint{.now = map_->View(), .previous = saved_};
      saved_ = batch_.checkpoint->now;
    }
    ASSERT_THAT(file_->Commit(batch_), IsOk());
    batch_ = Batch();
  }

  // Of all of them, in each way of asking.
  void ExpectKept(MissionFile& file) {
    std::vector<map::ContactEstimate> all;
    for (const auto& [key, kept] : kept_) {
      std::vector<map::ContactEstimate> expected;
      for (const auto& [place, estimate] : kept) expected.push_back(estimate);
      std::vector<map::ContactEstimate> found;
      ASSERT_THAT(file.ReadContactHistory(key, Time::min(), Time::max(),
                                          [&](const ContactHistoryRow& row) {
                                            found.push_back(row.estimate);
                                            return true;
                                          }),
                  IsOk());
      ASSERT_EQ(found.size(), expected.size()) << key.contact.value;
      ASSERT_EQ(found, expected) << key.contact.value;
      all.insert(all.end(), expected.begin(), expected.end());
    }
    FATHOM_ASSERT_OK_AND_ASSIGN(
        const std::vector<ContactHistoryRow> everywhere,
        file.ReadContactHistoryIn({}, Time::min(), Time::max(), all.size()));
    ASSERT_EQ(everywhere.size(), all.size());
    for (std::size_t i = 0; i < all.size(); ++i) {
      ASSERT_EQ(everywhere[i].estimate, all[i]) << i;
    }
  }

  const TempDir dir_;
  std::unique_ptr<MissionFile> file_;
  std::unique_ptr<map::ObstacleMap> map_;
  std::shared_ptr<const map::ObstacleMapView> saved_;
  Batch batch_;
  std::map<map::ContactKey, Kept> kept_;
};

// Reports in order and late ones, small and large commits, checkpoints: the
// file says what a plain list says, now, after a crash, after a clean end.
TEST_F(HistoryFileTest, IsWhatAPlainListSaysWhateverHappens) {
  std::mt19937 random(4);
  std::uniform_int_distribution<int> percent(0, 99);
  std::uniform_int_distribution<int> late_s(1, 70);
  int crashes = 0;
  for (int i = 0; i < 3000; ++i) {
    // The first of four reports most often: blocks of its own.
    const int who = percent(random) < 70 ? 0 : i % 4;
    map::ContactReport report = SampleReport(i, "c" + std::to_string(who));
    if (percent(random) < 10) {
      report.time -= std::chrono::seconds(late_s(random));
      std::get<map::ContactFix>(report.observation).position.longitude_deg +=
          1e-4;
    }
    Report(report);
    if (percent(random) < 20) Commit(percent(random) < 3);
    if (i % 500 == 499) {
      Commit(false);
      ExpectKept(*file_);
      // As a power cut leaves it.
      const std::string cut = dir_.File("cut" + std::to_string(crashes++));
      for (const char* end : {"", "-wal"}) {
        std::filesystem::copy_file(path() + end, cut + end);
      }
      {
        FATHOM_ASSERT_OK_AND_ASSIGN(const Proof proof, ProveFile(cut));
        EXPECT_THAT(proof.problems, IsEmpty());
        std::size_t rows = 0;
        for (const auto& [key, kept] : kept_) rows += kept.size();
        EXPECT_EQ(proof.history_rows, rows);
        FATHOM_ASSERT_OK_AND_ASSIGN(const MissionInfo info, ReadInfo(cut));
        EXPECT_EQ(info.history_rows, rows);
        EXPECT_EQ(info.contacts, kept_.size());
      }
      FATHOM_ASSERT_OK_AND_ASSIGN(const auto again, MissionFile::Open(cut));
      ASSERT_THAT(again->Load(), IsOk());
      ExpectKept(*again);
    }
  }
  EXPECT_GT(file_->Status().history.estimates, 10 * kBlockEstimates);
  ASSERT_THAT(file_->Close(), IsOk());
  file_.reset();
  FATHOM_ASSERT_OK_AND_ASSIGN(file_, MissionFile::Open(path()));
  ASSERT_THAT(file_->Load(), IsOk());
  ExpectKept(*file_);
  ASSERT_THAT(file_->Close(), IsOk());
  file_.reset();
  FATHOM_ASSERT_OK_AND_ASSIGN(const ExportedContacts exported,
                              ExportFile(path(), dir_.File("tracks.gpkg")));
  std::size_t rows = 0;
  for (const auto& [key, kept] : kept_) rows += kept.size();
  EXPECT_EQ(exported.points, rows);
  FATHOM_ASSERT_OK_AND_ASSIGN(const Repair repaired,
                              RepairMission(path(), dir_.File("repaired")));
  EXPECT_EQ(repaired.history_rows, rows);
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto copy,
                              MissionFile::Open(dir_.File("repaired")));
  ExpectKept(*copy);
}

TEST_F(HistoryFileTest, JournalMustBeLoadedBeforeMoreIsWritten) {
  Report(SampleReport(1, "a"));
  Commit(false);
  const std::string cut = dir_.File("cut");
  for (const char* end : {"", "-wal"}) {
    std::filesystem::copy_file(path() + end, cut + end);
  }
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto again, MissionFile::Open(cut));
  Report(SampleReport(2, "a"));
  EXPECT_THAT(again->Commit(batch_),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       HasSubstr("Load it before")));
  ASSERT_THAT(again->Load(), IsOk());
  EXPECT_THAT(again->Commit(batch_), IsOk());
}

TEST_F(HistoryFileTest, AreaAndTimeFindWhatAPlainSearchFinds) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> latitude(-60, 60);
  std::uniform_real_distribution<double> longitude(-180, 180);
  // Fleets about forty places, also about the antimeridian.
  for (int i = 0; i < 2000; ++i) {
    const int who = i % 40;
    std::mt19937 home(static_cast<unsigned>(who));
    map::ContactReport report = SampleReport(i, "c" + std::to_string(who));
    auto& fix = std::get<map::ContactFix>(report.observation);
    fix.position = {.latitude_deg = latitude(home) + 1e-5 * i,
                    .longitude_deg = longitude(home)};
    if (who % 8 == 0) {
      fix.position.longitude_deg = i % 80 < 40 ? 179.9999 : -179.9999;
    }
    Report(report);
    if (i % 100 == 99) Commit(i % 500 == 499);
  }
  Commit(false);
  int found_some = 0;
  for (int i = 0; i < 60; ++i) {
    HistoryArea area{.south_deg = latitude(random),
                     .north_deg = 0,
                     .west_deg = longitude(random),
                     .east_deg = longitude(random)};
    area.north_deg = area.south_deg + 20;
    const Time from = HistoryTime(200 + 30 * i);
    const Time to = from + std::chrono::seconds(500);
    std::vector<map::ContactEstimate> expected;
    for (const auto& [key, kept] : kept_) {
      for (const auto& [place, estimate] : kept) {
        if (place.first >= from && place.first <= to &&
            area.Holds(estimate.Position())) {
          expected.push_back(estimate);
        }
      }
    }
    FATHOM_ASSERT_OK_AND_ASSIGN(
        const std::vector<ContactHistoryRow> found,
        file_->ReadContactHistoryIn(area, from, to, 10'000));
    ASSERT_EQ(found.size(), expected.size()) << i;
    for (std::size_t k = 0; k < found.size(); ++k) {
      ASSERT_EQ(found[k].estimate, expected[k]);
    }
    if (expected.empty()) continue;
    ++found_some;
    const std::atomic<bool> stop = true;
    EXPECT_THAT(file_->ReadContactHistoryIn(area, from, to, 10'000, &stop),
                StatusIs(absl::StatusCode::kCancelled));
    EXPECT_THAT(
        file_->ReadContactHistoryIn(area, from, to, expected.size() - 1),
        StatusIs(absl::StatusCode::kResourceExhausted));
  }
  EXPECT_GT(found_some, 20);
}

TEST(HistoryArea, HoldsItsBordersAndCrossesTheAntimeridian) {
  const HistoryArea plain{
      .south_deg = 10, .north_deg = 20, .west_deg = 30, .east_deg = 40};
  EXPECT_TRUE(plain.Holds({.latitude_deg = 10, .longitude_deg = 40}));
  EXPECT_FALSE(plain.Holds({.latitude_deg = 9.9, .longitude_deg = 35}));
  EXPECT_FALSE(plain.Holds({.latitude_deg = 15, .longitude_deg = 41}));
  const HistoryArea across{
      .south_deg = 10, .north_deg = 20, .west_deg = 170, .east_deg = -170};
  EXPECT_TRUE(across.Holds({.latitude_deg = 15, .longitude_deg = 175}));
  EXPECT_TRUE(across.Holds({.latitude_deg = 15, .longitude_deg = -175}));
  EXPECT_FALSE(across.Holds({.latitude_deg = 15, .longitude_deg = 0}));
}

TEST_F(HistoryFileTest, WhatIsOlderThanAllowedGoesWithACheckpoint) {
  file_->LimitHistory({.max_age = std::chrono::seconds(300), .max_bytes = {}});
  // Blocks of 128 s each (reports once a second), a checkpoint after 1000.
  for (int i = 0; i < 1000; ++i) {
    Report(SampleReport(i, "a"));
    if (i % 64 == 63 || i == 999) Commit(i == 999);
  }
  // The newest is of 999 s; 699 s and later stay, with the block that holds
  // 699: from 640 = 5 * 128 on.
  const HistoryTotal total = file_->Status().history;
  EXPECT_EQ(total.forgotten_estimates, 640u);
  EXPECT_EQ(total.estimates, 360u);
  std::vector<std::uint64_t> revisions;
  ASSERT_THAT(file_->ReadContactHistory({.source = {"c4i"}, .contact = {"a"}},
                                        Time::min(), Time::max(),
                                        [&](const ContactHistoryRow& row) {
                                          revisions.push_back(row.revision);
                                          return true;
                                        }),
              IsOk());
  EXPECT_EQ(revisions.size(), 360u);
  EXPECT_EQ(revisions.front(), 641u);
  FATHOM_ASSERT_OK_AND_ASSIGN(const Proof proof, file_->Verify());
  EXPECT_THAT(proof.problems, IsEmpty());
}

// A ping's clock says nothing of the contacts: one of 2090 would let all go.
TEST_F(HistoryFileTest, AgeIsBesideTheNewestEstimateWhateverTheMapSays) {
  ASSERT_THAT(map_->RestoreRevision(0, HistoryTime(0) + std::chrono::years(80)),
              IsOk());
  saved_ = map_->View();
  file_->LimitHistory({.max_age = std::chrono::seconds(300), .max_bytes = {}});
  for (int i = 0; i < 100; ++i) Report(SampleReport(i, "a"));
  Commit(true);
  Report(SampleReport(100, "a"));
  Commit(true);
  EXPECT_EQ(saved_->as_of(), HistoryTime(0) + std::chrono::years(80));
  const HistoryTotal total = file_->Status().history;
  EXPECT_EQ(total.forgotten_estimates, 0u);
  EXPECT_EQ(total.estimates, 101u);
}

// A checkpoint writes a block of each contact that has a tail.
TEST_F(HistoryFileTest, AsMuchGoesAsACheckpointWrites) {
  file_->LimitHistory({.max_age = {}, .max_bytes = 0});
  for (int i = 0; i < 1500; ++i) {
    batch_.contact_history.push_back(SampleHistoryRow(i, 1));
    batch_.contact_history.back().estimate.key = {
        .source = {"c4i"}, .contact = {std::to_string(i)}};
  }
  Commit(true);
  const HistoryTotal total = file_->Status().history;
  EXPECT_EQ(total.estimates, 0u);
  EXPECT_EQ(total.forgotten_estimates, 1500u);
}

// The limit counts what GDAL is shown too; it used to count the blocks alone.
TEST_F(HistoryFileTest, BytesAreThoseOfTheBlocksAndTheirFeatures) {
  // Full blocks of five contacts, and blocks of one estimate of fifty.
  for (int i = 0; i < 5 * 512 + 50; ++i) {
    Report(SampleReport(i, i < 5 * 512 ? "vessel-" + std::to_string(i % 5)
                                       : "once-" + std::to_string(i)));
    if (i % 64 == 63) Commit(false);
  }
  Commit(true);
  const HistoryTotal total = file_->Status().history;
  EXPECT_EQ(total.estimates, 5u * 512 + 50);
  EXPECT_EQ(total.blocks, 5u * 4 + 50);
  ASSERT_THAT(file_->Close(), IsOk());
  file_.reset();
  {
    FATHOM_ASSERT_OK_AND_ASSIGN(
        Connection connection,
        Connection::Open(path(), Connection::Mode::kReadOnly));
    FATHOM_ASSERT_OK_AND_ASSIGN(
        const std::int64_t contents,
        connection.QueryInt(
            "SELECT sum(length(content)) FROM contact_history"));
    EXPECT_EQ(static_cast<std::int64_t>(total.content_bytes), contents);
    FATHOM_ASSERT_OK_AND_ASSIGN(
        const std::int64_t features,
        connection.QueryInt("SELECT sum(payload) FROM dbstat WHERE name IN "
                            "('tracks', 'track_points')"));
    EXPECT_NEAR(static_cast<double>(total.bytes() - total.content_bytes),
                static_cast<double>(features),
                0.1 * static_cast<double>(features));
  }
  FATHOM_ASSERT_OK_AND_ASSIGN(file_, MissionFile::Open(path()));
  EXPECT_EQ(file_->Status().history, total);
}

TEST_F(HistoryFileTest, NothingIsReadAfterClose) {
  Report(SampleReport(1, "a"));
  Commit(false);
  ASSERT_THAT(file_->Close(), IsOk());
  EXPECT_THAT(file_->ReadContactHistory(
                  {.source = {"c4i"}, .contact = {"a"}}, Time::min(),
                  Time::max(), [](const ContactHistoryRow&) { return true; }),
              StatusIs(absl::StatusCode::kFailedPrecondition));
  EXPECT_THAT(file_->ReadContactHistoryIn({}, Time::min(), Time::max(), 10),
              StatusIs(absl::StatusCode::kFailedPrecondition));
}

// A copy of the mission with one byte changed in the first page of a table or
// index.
std::string CopyWithDamage(const std::string& path, const std::string& of) {
  std::string damaged = path + "." + of;
  std::filesystem::copy_file(path, damaged);
  std::int64_t page = 0;
  {
    auto connection = Connection::Open(path, Connection::Mode::kReadOnly);
    page = *connection->QueryInt(
        "SELECT rootpage FROM sqlite_schema WHERE name = '" + of + "'");
  }
  std::fstream bytes(damaged, std::ios::in | std::ios::out | std::ios::binary);
  bytes.seekp((page - 1) * 8192 + 4000);
  bytes.put('x');
  return damaged;
}

// Of one damaged page of what is beside the blocks: they are kept all the same.
TEST_F(HistoryFileTest, RepairNeedsTheBlocksAlone) {
  for (int i = 0; i < 1000; ++i) {
    Report(SampleReport(i, "c" + std::to_string(i % 3)));
    if (i % 100 == 99) Commit(i == 899);
  }
  ASSERT_THAT(file_->Close(), IsOk());
  file_.reset();
  for (const std::string page_of :
       {"contact_history_total", "sqlite_autoindex_contact_1", "tracks"}) {
    const std::string damaged = CopyWithDamage(path(), page_of);
    FATHOM_ASSERT_OK_AND_ASSIGN(const Repair repair,
                                RepairMission(damaged, damaged + ".repaired"));
    EXPECT_EQ(repair.history_rows, 1000u) << page_of;
    FATHOM_ASSERT_OK_AND_ASSIGN(const auto mended,
                                MissionFile::Open(damaged + ".repaired"));
    ExpectKept(*mended);
    EXPECT_EQ(mended->Status().history.estimates, 1000u) << page_of;
  }
}

// Contact "once" has one estimate: no line goes through that.
TEST_F(HistoryFileTest, FeaturesThatSayOtherwiseAreToldAndRepaired) {
  Report(SampleReport(0, "once"));
  for (int i = 1; i <= 600; ++i) {
    Report(SampleReport(i, "c" + std::to_string(i % 2)));
    if (i % 100 == 0) Commit(false);
  }
  ASSERT_THAT(file_->Close(), IsOk());
  file_.reset();
  const auto problems = [](const std::string& of) {
    return ProveFile(of)->problems;
  };
  ASSERT_THAT(problems(path()), IsEmpty());
  {
    FATHOM_ASSERT_OK_AND_ASSIGN(
        Connection connection,
        Connection::Open(path(), Connection::Mode::kReadOnly));
    EXPECT_THAT(connection.QueryInt("SELECT sum(estimates) FROM tracks"),
                IsOkAndHolds(601));
    // Their headers (17 bytes) and 16 bytes a vertex.
    EXPECT_THAT(connection.QueryInt(
                    "SELECT count(*) FROM tracks JOIN track_points "
                    "USING (fid) WHERE CASE tracks.contact_id WHEN 'once' "
                    "THEN tracks.geom IS NULL ELSE "
                    "length(tracks.geom) = 17 + 16 * estimates END"),
                IsOkAndHolds(*connection.QueryInt(
                    "SELECT count(*) FROM contact_history")));
  }
  int number = 0;
  for (const std::string change :
       {"UPDATE tracks SET estimates = estimates + 1 WHERE fid = 2",
        "UPDATE tracks SET start_time = end_time WHERE fid = 2",
        "UPDATE tracks SET contact_id = 'x' WHERE fid = 2",
        "UPDATE tracks SET geom = (SELECT geom FROM tracks WHERE fid = 3) "
        "WHERE fid = 2",
        "UPDATE tracks SET geom = NULL WHERE fid = 2",
        "UPDATE track_points SET geom = (SELECT geom FROM track_points WHERE "
        "fid = 3) WHERE fid = 2",
        "UPDATE track_points SET status = 4 WHERE fid = 2",
        "DELETE FROM track_points WHERE fid = 2",
        "DELETE FROM tracks WHERE fid = 2",
        "INSERT INTO track_points SELECT 1000, geom, contact_number, "
        "source_id, contact_id, time, contact_class, status, "
        "velocity_north_m_s, velocity_east_m_s, speed_m_s, course_deg, "
        "std_north_m, std_east_m FROM track_points WHERE fid = 2"}) {
    const std::string changed = path() + std::to_string(++number);
    std::filesystem::copy_file(path(), changed);
    {
      FATHOM_ASSERT_OK_AND_ASSIGN(
          Connection connection,
          Connection::Open(changed, Connection::Mode::kReadWrite));
      ASSERT_THAT(connection.Execute(change), IsOk());
      ASSERT_THAT(connection.CheckpointTruncate(), IsOk());
    }
    EXPECT_THAT(problems(changed), ElementsAre(HasSubstr("track_points")))
        << change;
    FATHOM_ASSERT_OK_AND_ASSIGN(const Repair repair,
                                RepairMission(changed, changed + ".repaired"));
    EXPECT_EQ(repair.history_rows, 601u);
    EXPECT_THAT(problems(changed + ".repaired"), IsEmpty()) << change;
  }
}

TEST_F(HistoryFileTest, WhatCannotBeCountedIsToldAndTheRestIsCounted) {
  for (int i = 0; i < 6; ++i) {
    Report(SampleReport(i, "c" + std::to_string(i % 3)));
  }
  Commit(false);
  ASSERT_THAT(file_->Close(), IsOk());
  file_.reset();
  const auto info_of = [this](const char* damaged) {
    return ReadInfo(CopyWithDamage(path(), damaged));
  };
  FATHOM_ASSERT_OK_AND_ASSIGN(const MissionInfo sound, ReadInfo(path()));
  EXPECT_TRUE(sound.damage.empty());
  EXPECT_EQ(sound.history_rows, 6u);
  EXPECT_EQ(sound.contacts, 3u);
  FATHOM_ASSERT_OK_AND_ASSIGN(const MissionInfo total,
                              info_of("contact_history_total"));
  EXPECT_THAT(total.damage, ElementsAre(HasSubstr("checksum")));
  EXPECT_EQ(total.history_rows, std::nullopt);
  EXPECT_EQ(total.contacts, 3u);
  EXPECT_EQ(total.journal_records, sound.journal_records);
  FATHOM_ASSERT_OK_AND_ASSIGN(const MissionInfo tiles, info_of("tile"));
  EXPECT_THAT(tiles.damage, ElementsAre(HasSubstr("checksum")));
  EXPECT_EQ(tiles.tiles, std::nullopt);
  EXPECT_EQ(tiles.history_rows, 6u);
  // The history may go on in it.
  FATHOM_ASSERT_OK_AND_ASSIGN(const MissionInfo journal, info_of("journal"));
  EXPECT_THAT(journal.damage, SizeIs(2));
  EXPECT_EQ(journal.journal_records, std::nullopt);
  EXPECT_EQ(journal.history_rows, std::nullopt);
  EXPECT_EQ(journal.tiles, sound.tiles);
  // Who it is has to be known.
  EXPECT_THAT(info_of("mission"), StatusIs(absl::StatusCode::kDataLoss));
}

TEST_F(HistoryFileTest, WhatIsMoreThanAllowedGoesOldestFirst) {
  for (int i = 0; i < 1280; ++i) {
    Report(SampleReport(i, i % 2 == 0 ? "even" : "odd"));
    if (i % 64 == 63) Commit(false);
  }
  Commit(true);
  const HistoryTotal all = file_->Status().history;
  EXPECT_EQ(all.estimates, 1280u);
  file_->LimitHistory({.max_age = {}, .max_bytes = all.bytes() / 2});
  Report(SampleReport(1280, "even"));
  Commit(true);
  const HistoryTotal half = file_->Status().history;
  EXPECT_LE(half.bytes(), all.bytes() / 2);
  EXPECT_GT(half.bytes(), all.bytes() / 3);
  EXPECT_EQ(half.estimates + half.forgotten_estimates, 1281u);
  // Of both, the newest half.
  for (const char* contact : {"even", "odd"}) {
    std::vector<std::uint64_t> revisions;
    ASSERT_THAT(
        file_->ReadContactHistory({.source = {"c4i"}, .contact = {contact}},
                                  Time::min(), Time::max(),
                                  [&](const ContactHistoryRow& row) {
                                    revisions.push_back(row.revision);
                                    return true;
                                  }),
        IsOk());
    EXPECT_GT(revisions.front(), 500u);
    EXPECT_LT(revisions.front(), 900u);
  }
  // What was forgotten stays forgotten, and counted.
  ASSERT_THAT(file_->Close(), IsOk());
  file_.reset();
  FATHOM_ASSERT_OK_AND_ASSIGN(file_, MissionFile::Open(path()));
  EXPECT_EQ(file_->Status().history, half);
}

}  // namespace
}  // namespace fathom::storage
