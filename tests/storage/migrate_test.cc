// Missions of every format that was ever in use open, whole.

#include "storage/migrate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "absl/strings/str_format.h"
#include "storage/checked_pages.h"
#include "storage/mission_file.h"
#include "storage/offline.h"
#include "storage/restore.h"
#include "storage/sqlite.h"
#include "tests/storage/temp_dir.h"
#include "tests/testing/status_matchers.h"

namespace fathom::storage {
namespace {

using ::fathom::testing::IsOk;
using ::fathom::testing::IsOkAndHolds;
using ::fathom::testing::StatusIs;
using ::testing::AnyOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;

std::string ReadAll(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return std::string(std::istreambuf_iterator<char>(file), {});
}

// Reports about a third contact, in golden missions from version 9 on.
constexpr std::uint64_t kThirdReports = 300;

// What tests/golden/make puts into every golden mission. Its digest then is not
// asked for: replayed reports are fused as this program fuses them. `third`: 0
// or kThirdReports.
void ExpectGolden(MissionFile& file, std::uint64_t third = 0) {
  FATHOM_ASSERT_OK_AND_ASSIGN(
      const RestoredMap restored,
      RestoreMap(*file.Load(), *OptionsOf(file.metadata())));
  EXPECT_EQ(restored.refused_records, 0u);
  const auto view = restored.map->View();
  // A chart, 2 starts, 60 pings, 1 completion, 20 reports, 1 drop.
  EXPECT_EQ(view->revision(), 1u + 2 + 60 + 1 + 20 + 1 + third);
  EXPECT_EQ(view->activities().size(), 2u);
  const std::size_t others = third > 0 ? 1 : 0;
  EXPECT_EQ(view->contacts().size(), 2u + others);
  EXPECT_EQ(view->contacts().live_count(), 1u + others);
  // The nine cells of the first activity, and the chart about them.
  EXPECT_GT(view->global().known_leaf_count(), 9u);
  FATHOM_ASSERT_OK_AND_ASSIGN(const Proof proof, file.Verify());
  EXPECT_THAT(proof.problems, IsEmpty());
  EXPECT_EQ(proof.history_rows, 21u + third);
}

// Made with the last program of version 5.
TEST(Migrate, MissionOfVersion5IsBackedUpAndBroughtToThisOne) {
  const TempDir dir;
  const std::string path = dir.File("m");
  const std::string golden =
      FATHOM_SOURCE_DIR "/tests/golden/mission-v5.fathom";
  std::filesystem::copy_file(golden, path);
  for (int time = 0; time < 2; ++time) {
    FATHOM_ASSERT_OK_AND_ASSIGN(const auto file, MissionFile::Open(path));
    ExpectGolden(*file);
    ASSERT_THAT(file->Close(), IsOk());
  }
  EXPECT_EQ(ReadAll(path)[63], kSchemaVersion);
  EXPECT_EQ(ReadAll(path)[20], kPageChecksumBytes);
  EXPECT_EQ(ReadAll(path + ".v5.bak")[63], 5);
}

// Its history is in rows, ours in blocks.
TEST(Migrate, MissionOfVersion6IsBackedUpAndBroughtToThisOne) {
  const TempDir dir;
  const std::string path = dir.File("m");
  std::filesystem::copy_file(
      FATHOM_SOURCE_DIR "/tests/golden/mission-v6.fathom", path);
  // The verbs that only read do not ask for that.
  FATHOM_ASSERT_OK_AND_ASSIGN(const Proof as_it_was, ProveFile(path));
  EXPECT_THAT(as_it_was.problems, IsEmpty());
  EXPECT_EQ(as_it_was.history_rows, 21u);
  FATHOM_ASSERT_OK_AND_ASSIGN(const ExportedContacts exported,
                              ExportFile(path, dir.File("before.gpkg")));
  EXPECT_EQ(exported.points, 21u);
  FATHOM_ASSERT_OK_AND_ASSIGN(const Repair repaired,
                              RepairMission(path, dir.File("repaired")));
  EXPECT_THAT(repaired.left_out, IsEmpty());
  EXPECT_EQ(repaired.history_rows, 21u);
  EXPECT_EQ(ReadAll(path)[63], 6);
  for (int time = 0; time < 2; ++time) {
    FATHOM_ASSERT_OK_AND_ASSIGN(const auto file, MissionFile::Open(path));
    ExpectGolden(*file);
    ASSERT_THAT(file->Close(), IsOk());
  }
  EXPECT_EQ(ReadAll(path)[63], kSchemaVersion);
  EXPECT_EQ(ReadAll(path + ".v6.bak")[63], 6);
}

// Its history has no features. One copied while it was served, with a journal
// and no block; one closed, with a block of each of two contacts.
TEST(Migrate, MissionOfVersion7IsBackedUpAndBroughtToThisOne) {
  for (const bool closed : {false, true}) {
    const TempDir dir;
    const std::string path = dir.File("m");
    std::filesystem::copy_file(
        closed ? FATHOM_SOURCE_DIR "/tests/golden/mission-v7-closed.fathom"
               : FATHOM_SOURCE_DIR "/tests/golden/mission-v7.fathom",
        path);
    FATHOM_ASSERT_OK_AND_ASSIGN(const Proof as_it_was, ProveFile(path));
    EXPECT_THAT(as_it_was.problems, IsEmpty());
    EXPECT_EQ(as_it_was.history_rows, 21u);
    EXPECT_EQ(ReadAll(path)[63], 7);
    for (int time = 0; time < 2; ++time) {
      FATHOM_ASSERT_OK_AND_ASSIGN(const auto file, MissionFile::Open(path));
      ExpectGolden(*file);
      if (time == 0) {
        FATHOM_ASSERT_OK_AND_ASSIGN(
            Connection connection,
            Connection::Open(path, Connection::Mode::kReadOnly));
        EXPECT_THAT(connection.QueryInt("SELECT count(*) FROM tracks"),
                    IsOkAndHolds(closed ? 2 : 0));
      }
      ASSERT_THAT(file->Close(), IsOk());
    }
    EXPECT_EQ(ReadAll(path)[63], kSchemaVersion);
    EXPECT_EQ(ReadAll(path + ".v7.bak")[63], 7);
  }
}

// A block that cannot be read has no features and is told as before; the rest
// is served, as it was in version 7.
TEST(Migrate, DamagedBlockOfVersion7IsToldAndTheRestServed) {
  const TempDir dir;
  const std::string path = dir.File("m");
  std::filesystem::copy_file(
      FATHOM_SOURCE_DIR "/tests/golden/mission-v7-closed.fathom", path);
  {
    FATHOM_ASSERT_OK_AND_ASSIGN(
        Connection connection,
        Connection::Open(path, Connection::Mode::kReadWrite));
    ASSERT_THAT(connection.Execute("UPDATE contact_history SET content = "
                                   "zeroblob(9) WHERE block_id = 1"),
                IsOk());
    ASSERT_THAT(connection.CheckpointTruncate(), IsOk());
  }
  {
    FATHOM_ASSERT_OK_AND_ASSIGN(const auto file, MissionFile::Open(path));
    ASSERT_THAT(file->Close(), IsOk());
  }
  EXPECT_EQ(ReadAll(path)[63], kSchemaVersion);
  {
    FATHOM_ASSERT_OK_AND_ASSIGN(
        Connection connection,
        Connection::Open(path, Connection::Mode::kReadOnly));
    EXPECT_THAT(connection.QueryInt("SELECT group_concat(fid) FROM tracks"),
                IsOkAndHolds(2));
  }
  FATHOM_ASSERT_OK_AND_ASSIGN(const Proof damaged, ProveFile(path));
  EXPECT_THAT(damaged.problems, Contains(HasSubstr("block_id=1 ")));
  EXPECT_THAT(damaged.problems, Not(Contains(HasSubstr("block_id=2 "))));
  FATHOM_ASSERT_OK_AND_ASSIGN(const Repair repaired,
                              RepairMission(path, dir.File("repaired")));
  EXPECT_EQ(repaired.left_out.size(), 1u);
  // The other block: one contact has 10 estimates, the other 11.
  EXPECT_THAT(repaired.history_rows, AnyOf(10u, 11u));
  FATHOM_ASSERT_OK_AND_ASSIGN(const Proof proof,
                              ProveFile(dir.File("repaired")));
  EXPECT_THAT(proof.problems, IsEmpty());
}

// What Open tells, with so long between two lines at least.
std::vector<std::string> ToldOf(const std::string& golden,
                                std::chrono::milliseconds interval) {
  const TempDir dir;
  const std::string path = dir.File("m");
  std::filesystem::copy_file(
      std::string(FATHOM_SOURCE_DIR "/tests/golden/") + golden, path);
  std::vector<std::string> told;
  EXPECT_THAT(
      MissionFile::Open(
          path, {.tell = [&](const std::string& line) { told.push_back(line); },
                 .interval = interval}),
      IsOk());
  return told;
}

// A history of a year took minutes without a word.
TEST(Migrate, TellsAtItsBeginningItsEndAndNowAndThenBetween) {
  constexpr std::chrono::milliseconds kNever = std::chrono::hours(1);
  for (const int version : {5, 6, 7, 8}) {
    const std::string golden = absl::StrFormat("mission-v%d%s.fathom", version,
                                               version == 7 ? "-closed" : "");
    EXPECT_THAT(
        ToldOf(golden, kNever),
        ElementsAre(
            HasSubstr(absl::StrFormat("is of format %d and", version)),
            HasSubstr(absl::StrFormat("is of format %d now", kSchemaVersion))));
  }
  EXPECT_THAT(ToldOf("mission-v9-closed.fathom", kNever), IsEmpty());
  // 21 rows; two blocks of 10 and 11 estimates, in either order.
  const auto rows = ToldOf("mission-v6.fathom", std::chrono::milliseconds(0));
  EXPECT_THAT(rows, SizeIs(2 + 21));
  EXPECT_THAT(rows[21], HasSubstr("21 estimates"));
  const auto blocks =
      ToldOf("mission-v7-closed.fathom", std::chrono::milliseconds(0));
  ASSERT_THAT(blocks, SizeIs(2 + 2));
  EXPECT_THAT(blocks[1],
              AnyOf(HasSubstr("10 of 21 est"), HasSubstr("11 of 21 est")));
  EXPECT_THAT(blocks[2], HasSubstr("21 of 21 estimates"));
}

// No contact has older estimates.
TEST(Migrate, MissionOfVersion8IsBackedUpAndBroughtToThisOne) {
  for (const char* name : {"mission-v8.fathom", "mission-v8-closed.fathom"}) {
    const TempDir dir;
    const std::string path = dir.File("m");
    std::filesystem::copy_file(
        std::string(FATHOM_SOURCE_DIR "/tests/golden/") + name, path);
    FATHOM_ASSERT_OK_AND_ASSIGN(const Proof as_it_was, ProveFile(path));
    EXPECT_THAT(as_it_was.problems, IsEmpty());
    EXPECT_EQ(ReadAll(path)[63], 8);
    for (int time = 0; time < 2; ++time) {
      FATHOM_ASSERT_OK_AND_ASSIGN(const auto file, MissionFile::Open(path));
      ExpectGolden(*file);
      ASSERT_THAT(file->Close(), IsOk());
    }
    EXPECT_EQ(ReadAll(path)[63], kSchemaVersion);
    EXPECT_EQ(ReadAll(path + ".v8.bak")[63], 8);
  }
}

// One copied while it was served, with a journal; one closed, with none. The
// third contact's past goes back to its first report, 256 of 300 before its
// newest estimates.
TEST(Migrate, MissionOfVersion9OpensAsItIs) {
  for (const char* name : {"mission-v9.fathom", "mission-v9-closed.fathom"}) {
    const TempDir dir;
    const std::string path = dir.File("m");
    std::filesystem::copy_file(
        std::string(FATHOM_SOURCE_DIR "/tests/golden/") + name, path);
    FATHOM_ASSERT_OK_AND_ASSIGN(const auto file, MissionFile::Open(path));
    ExpectGolden(*file, kThirdReports);
    EXPECT_FALSE(std::filesystem::exists(path + ".v9.bak"));
    FATHOM_ASSERT_OK_AND_ASSIGN(
        const RestoredMap restored,
        RestoreMap(*file->Load(), *OptionsOf(file->metadata())));
    const auto view = restored.map->View();
    const map::ContactKey third = {.source = {"ais"}, .contact = {"trawler"}};
    // tests/golden/make: every 30 s from 2026-01-01T00:00:30Z.
    const Time start = TimeFromUnixMicros(1'767'225'600'000'000);
    const map::Contact* contact = view->contacts().Find(third);
    ASSERT_NE(contact, nullptr);
    EXPECT_EQ(contact->older().size(), kThirdReports - 256);
    EXPECT_FALSE(view->contacts().At(third, start).has_value());
    const auto first =
        view->contacts().At(third, start + std::chrono::seconds(45));
    ASSERT_TRUE(first.has_value());
    EXPECT_LT(first->P(0, 0), 100);
  }
}

}  // namespace
}  // namespace fathom::storage
