// Missions of every format that was ever in use open, whole.

#include "storage/migrate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "storage/checked_pages.h"
#include "storage/mission_file.h"
#include "storage/offline.h"
#include "storage/restore.h"
#include "tests/storage/temp_dir.h"
#include "tests/testing/status_matchers.h"

namespace fathom::storage {
namespace {

using ::fathom::testing::IsOk;
using ::testing::IsEmpty;

std::string ReadAll(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return std::string(std::istreambuf_iterator<char>(file), {});
}

// What tests/golden/make puts into every golden mission. Its digest then is not
// asked for: replayed reports are fused as this program fuses them.
void ExpectGolden(MissionFile& file) {
  FATHOM_ASSERT_OK_AND_ASSIGN(
      const RestoredMap restored,
      RestoreMap(*file.Load(), *OptionsOf(file.metadata())));
  EXPECT_EQ(restored.refused_records, 0u);
  const auto view = restored.map->View();
  // A chart, 2 starts, 60 pings, 1 completion, 20 reports, 1 drop.
  EXPECT_EQ(view->revision(), 1u + 2 + 60 + 1 + 20 + 1);
  EXPECT_EQ(view->activities().size(), 2u);
  EXPECT_EQ(view->contacts().size(), 2u);
  EXPECT_EQ(view->contacts().live_count(), 1u);
  // The nine cells of the first activity, and the chart about them.
  EXPECT_GT(view->global().known_leaf_count(), 9u);
  FATHOM_ASSERT_OK_AND_ASSIGN(const Proof proof, file.Verify());
  EXPECT_THAT(proof.problems, IsEmpty());
  EXPECT_EQ(proof.history_rows, 21u);
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

// One copied while it was served, with a journal; one closed, with none.
TEST(Migrate, MissionOfVersion7OpensAsItIs) {
  for (const char* name : {"mission-v7.fathom", "mission-v7-closed.fathom"}) {
    const TempDir dir;
    const std::string path = dir.File("m");
    std::filesystem::copy_file(
        std::string(FATHOM_SOURCE_DIR "/tests/golden/") + name, path);
    FATHOM_ASSERT_OK_AND_ASSIGN(const auto file, MissionFile::Open(path));
    ExpectGolden(*file);
    EXPECT_FALSE(std::filesystem::exists(path + ".v7.bak"));
  }
}

}  // namespace
}  // namespace fathom::storage
