// The mission file and the disk around it: long reads, read-only files, damaged
// pages that are to be written.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>

#include "storage/checked_pages.h"
#include "storage/history_codec.h"
#include "storage/mission_file.h"
#include "storage/offline.h"
#include "storage/restore.h"
#include "storage/sqlite.h"
#include "tests/storage/event_script.h"
#include "tests/storage/sample_records.h"
#include "tests/storage/temp_dir.h"
#include "tests/testing/status_matchers.h"

namespace fathom::storage {
namespace {

using ::fathom::testing::IsOk;
using ::fathom::testing::StatusIs;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;

std::string ReadAll(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

// Batches of about 8 MiB of journal.
class LargeBatches {
 public:
  LargeBatches() {
    std::mt19937 random(1);
    for (int i = 0; i < 50; ++i) {
      batch_.journal.push_back(
          {0, PingRecord{.source = {"sonar"},
                         .epoch = 1,
                         .sequence = 0,
                         .ping = SamplePing(random, "leg", i, 20'000)}});
    }
  }
  const Batch& Next() {
    for (JournalRecord& record : batch_.journal) {
      record.revision = ++revision_;
      std::get<PingRecord>(record.event).sequence = revision_;
    }
    return batch_;
  }

 private:
  Batch batch_;
  std::uint64_t revision_ = 0;
};

TEST(MissionLog, StaysBoundedWhileNobodyReadsForLong) {
  const TempDir dir;
  FATHOM_ASSERT_OK_AND_ASSIGN(
      const auto file, MissionFile::Create(dir.File("m"), SampleMetadata()));
  LargeBatches batches;
  std::uint64_t written = 0;
  for (int i = 0; i < 30; ++i) {
    ASSERT_THAT(file->Commit(batches.Next()), IsOk());
    const MissionFileStatus status = file->Status();
    EXPECT_LE(status.wal_bytes, kWalKeepBytes);
    EXPECT_FALSE(status.log_starved);
    written = status.file_bytes + status.wal_bytes;
  }
  EXPECT_GT(written, 2 * kWalKeepBytes);
}

TEST(MissionLog, AReaderThatStarvesItIsToldAndItShrinksAfterwards) {
  const TempDir dir;
  FATHOM_ASSERT_OK_AND_ASSIGN(
      const auto file, MissionFile::Create(dir.File("m"), SampleMetadata()));
  LargeBatches batches;
  ASSERT_THAT(file->Commit(batches.Next()), IsOk());
  {
    FATHOM_ASSERT_OK_AND_ASSIGN(
        Connection reader,
        Connection::Open(dir.File("m"), Connection::Mode::kReadOnly));
    ASSERT_THAT(reader.Execute("BEGIN"), IsOk());
    ASSERT_THAT(reader.QueryInt("SELECT count(*) FROM journal"), IsOk());
    int commits = 0;
    while (!file->Status().log_starved) {
      ASSERT_THAT(file->Commit(batches.Next()), IsOk());
      ASSERT_LT(++commits, 100);
    }
    EXPECT_GT(file->Status().wal_bytes, kWalKeepBytes);
    // Ingest went on all the while; the reader saw its own state.
    EXPECT_GT(commits, 1);
  }
  // The next copy is due 32 MiB after the last try.
  int commits = 0;
  while (file->Status().log_starved) {
    ASSERT_THAT(file->Commit(batches.Next()), IsOk());
    ASSERT_LT(++commits, 20);
  }
  ASSERT_THAT(file->Commit(batches.Next()), IsOk());
  EXPECT_LE(file->Status().wal_bytes, kWalKeepBytes);
}

// Opened by a process without rights, whose status comes through a pipe (root
// may write everything: the child gives that up).
TEST(ReadOnlyMission, IsRefusedWithTheReasonAndUntouched) {
  const TempDir dir;
  const std::string path = dir.File("m");
  { ASSERT_THAT(MissionFile::Create(path, SampleMetadata()), IsOk()); }
  const std::string before = ReadAll(path);
  ASSERT_EQ(chmod(path.c_str(), 0444), 0);
  ASSERT_EQ(chmod(dir.path().c_str(), 0777), 0);
  int pipe_ends[2];
  ASSERT_EQ(pipe(pipe_ends), 0);
  const pid_t child = fork();
  if (child == 0) {
    if (getuid() == 0 && setuid(65534) != 0) _exit(2);
    const std::string told = MissionFile::Open(path).status().ToString();
    const ssize_t size = write(pipe_ends[1], told.data(), told.size());
    _exit(size == static_cast<ssize_t>(told.size()) ? 0 : 3);
  }
  close(pipe_ends[1]);
  char told[4096] = {};
  ASSERT_GE(read(pipe_ends[0], told, sizeof told - 1), 0);
  close(pipe_ends[0]);
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  ASSERT_EQ(WEXITSTATUS(status), 0);
  EXPECT_THAT(std::string(told),
              AllOf(HasSubstr("FAILED_PRECONDITION"), HasSubstr(path),
                    HasSubstr("read-only")));
  EXPECT_EQ(ReadAll(path), before);
}

// A mission of 110 events, in which a bit of the first page of the table or
// index `name` is turned.
void MakeDamagedMission(const std::string& path, const std::string& name) {
  map::ObstacleMap map(*OptionsOf(SampleMetadata()));
  EventScript script(map, nullptr);
  std::int64_t page = 0;
  {
    FATHOM_ASSERT_OK_AND_ASSIGN(const auto file,
                                MissionFile::Create(path, SampleMetadata()));
    for (int i = 0; i < 110; ++i) {
      script.Step();
      ASSERT_THAT(file->Commit(script.batch()), IsOk());
      script.Committed();
    }
    ASSERT_THAT(file->Close(), IsOk());
  }
  {
    FATHOM_ASSERT_OK_AND_ASSIGN(
        Connection connection,
        Connection::Open(path, Connection::Mode::kReadOnly));
    FATHOM_ASSERT_OK_AND_ASSIGN(
        page,
        connection.QueryInt(
            "SELECT rootpage FROM sqlite_schema WHERE name = '" + name + "'"));
  }
  std::string content = ReadAll(path);
  content[static_cast<std::size_t>(page - 1) * 8192 + 4000] ^= 1;
  std::ofstream(path, std::ios::binary) << content;
}

// The index by age serves retention and the reckoning of its limit, no reader.
TEST(DamagedPage, OfTheHistorysIndexLeavesTheMissionWhole) {
  const TempDir dir;
  const std::string path = dir.File("m");
  MakeDamagedMission(path, "contact_history_age");
  FATHOM_ASSERT_OK_AND_ASSIGN(auto file, MissionFile::Open(path));
  FATHOM_ASSERT_OK_AND_ASSIGN(const Loaded loaded, file->Load());
  EXPECT_TRUE(loaded.damage.empty());
  const HistoryTotal total = file->Status().history;
  EXPECT_GT(total.estimates, 0u);
  EXPECT_EQ(total.blocks,
            (total.estimates + kBlockEstimates - 1) / kBlockEstimates);
  std::size_t read = 0;
  for (const map::StoredContact& contact : loaded.contacts) {
    ASSERT_THAT(file->ReadContactHistory(contact.key, Time::min(), Time::max(),
                                         [&read](const ContactHistoryRow&) {
                                           ++read;
                                           return true;
                                         }),
                IsOk());
  }
  EXPECT_GT(read, 0u);
}

// A tile's page is damaged, and the next checkpoint is to write the tile.
TEST(DamagedPage, IsNeverWrittenOverUnseen) {
  const TempDir dir;
  const std::string path = dir.File("m");
  MakeDamagedMission(path, "tile");

  FATHOM_ASSERT_OK_AND_ASSIGN(auto file, MissionFile::Open(path));
  FATHOM_ASSERT_OK_AND_ASSIGN(Loaded loaded, file->Load());
  EXPECT_FALSE(loaded.damage.empty());
  FATHOM_ASSERT_OK_AND_ASSIGN(
      const RestoredMap restored,
      RestoreMap(std::move(loaded), *OptionsOf(SampleMetadata())));
  EventScript onward(*restored.map, restored.checkpoint);
  // The journal is elsewhere: events are still taken.
  onward.Step();
  ASSERT_THAT(file->Commit(onward.batch()), IsOk());
  onward.Committed();
  // The checkpoint has to read the page it writes to.
  while (!onward.batch().checkpoint.has_value()) onward.Step();
  const absl::Status written = file->Commit(onward.batch());
  EXPECT_THAT(written, StatusIs(absl::StatusCode::kDataLoss,
                                AllOf(HasSubstr("checksum"),
                                      HasSubstr("mission repair " + path))));
  // What was acknowledged is there, and a repair brings the mission back.
  ASSERT_THAT(file->Close(), IsOk());
  file.reset();
  FATHOM_ASSERT_OK_AND_ASSIGN(const Repair repair,
                              RepairMission(path, dir.File("repaired")));
  EXPECT_FALSE(repair.left_out.empty());
  EXPECT_EQ(repair.revision, 111u);
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto mended,
                              MissionFile::Open(dir.File("repaired")));
  FATHOM_ASSERT_OK_AND_ASSIGN(Loaded whole, mended->Load());
  EXPECT_TRUE(whole.damage.empty());
}

// Big-endian, as SQLite writes them.
std::size_t U32At(const std::string& file, std::size_t at) {
  std::size_t value = 0;
  for (int i = 0; i < 4; ++i) {
    value = value << 8 | static_cast<std::uint8_t>(file[at++]);
  }
  return value;
}

// Found by fuzzing: a start that read the same tiles again and again. The inner
// page's last pointer leads to its first leaf, whose first tile, in a damaged
// page, is skipped: the reading went on behind it.
TEST(DamagedPage, ThatLeadsBackEndsTheReading) {
  constexpr std::size_t kPageBytes = 8192;
  constexpr int kTiles = 100;
  const TempDir dir;
  const std::string path = dir.File("m");
  {
    FATHOM_ASSERT_OK_AND_ASSIGN(const auto file,
                                MissionFile::Create(path, SampleMetadata()));
    ASSERT_THAT(file->Close(), IsOk());
  }
  std::int64_t root_page = 0;
  {
    FATHOM_ASSERT_OK_AND_ASSIGN(
        Connection connection,
        Connection::Open(path, Connection::Mode::kReadWrite));
    FATHOM_ASSERT_OK_AND_ASSIGN(
        Statement insert,
        connection.Prepare("INSERT INTO tile (tile_key, content) VALUES (?, "
                           "?)"));
    for (int i = 0; i < kTiles; ++i) {
      // Not copied: it must be there when the statement runs.
      const Bytes content(20'000, static_cast<std::uint8_t>(i + 1));
      insert.BindInt(0, 1000 + i);
      insert.BindBlob(1, content);
      ASSERT_THAT(insert.Run(), IsOk());
    }
    FATHOM_ASSERT_OK_AND_ASSIGN(
        root_page,
        connection.QueryInt("SELECT rootpage FROM sqlite_schema WHERE name = "
                            "'tile'"));
    ASSERT_THAT(connection.CheckpointTruncate(), IsOk());
  }
  std::string content = ReadAll(path);
  const std::size_t inner =
      (static_cast<std::size_t>(root_page) - 1) * kPageBytes;
  // sqlite.org/fileformat2.html 1.6: an interior page of a table; the pointer
  // to its right-most child, and the place of its first cell, whose first
  // field is a pointer.
  ASSERT_EQ(content[inner], 5);
  const std::size_t first_cell = U32At(content, inner + 12) >> 16;
  const std::string first_leaf = content.substr(inner + first_cell, 4);
  ASSERT_NE(content.substr(inner + 8, 4), first_leaf);
  content.replace(inner + 8, 4, first_leaf);
  const std::uint32_t sum = PageChecksum(
      static_cast<std::uint32_t>(root_page),
      ByteSpan(reinterpret_cast<const std::uint8_t*>(&content[inner]),
               kPageBytes - kPageChecksumBytes));
  for (std::size_t i = 0; i < 4; ++i) {
    content[inner + kPageBytes - 4 + i] = static_cast<char>(sum >> (8 * i));
  }
  // What the first tile's row has in other pages.
  const std::size_t damaged = content.find(std::string(4000, '\1'));
  ASSERT_NE(damaged, std::string::npos);
  content[damaged + 100] ^= 1;
  std::ofstream(path, std::ios::binary) << content;

  FATHOM_ASSERT_OK_AND_ASSIGN(const auto file, MissionFile::Open(path));
  FATHOM_ASSERT_OK_AND_ASSIGN(const Loaded loaded, file->Load());
  EXPECT_THAT(loaded.damage, Contains(HasSubstr("order of their keys")));
}

}  // namespace
}  // namespace fathom::storage
