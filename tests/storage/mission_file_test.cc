// The contract of storage/mission_file.h, on files of a temporary folder.

#include "storage/mission_file.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
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
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

using FilePtr = std::unique_ptr<MissionFile>;

std::string ReadAll(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

std::vector<std::string> FilesIn(const TempDir& dir) {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(dir.path())) {
    names.push_back(entry.path().filename());
  }
  std::sort(names.begin(), names.end());
  return names;
}

map::MissionOptions Options() { return *OptionsOf(SampleMetadata()); }

absl::StatusOr<RestoredMap> OpenMap(MissionFile& file) {
  FATHOM_ASSIGN_OR_RETURN(Loaded loaded, file.Load());
  FATHOM_ASSIGN_OR_RETURN(const map::MissionOptions options,
                          OptionsOf(loaded.metadata));
  return RestoreMap(std::move(loaded), options);
}

TEST(MissionFile, ReopenedMissionHasItsMetadata) {
  const TempDir dir;
  MissionMetadata metadata = SampleMetadata();
  metadata.root_south_west.longitude_deg = -0.0;
  {
    FATHOM_ASSERT_OK_AND_ASSIGN(const FilePtr file,
                                MissionFile::Create(dir.File("m"), metadata));
    // SQLite keeps no sign of zero, so the mission has none from its start.
    EXPECT_FALSE(std::signbit(file->metadata().root_south_west.longitude_deg));
    EXPECT_EQ(file->metadata(), metadata);
  }
  FATHOM_ASSERT_OK_AND_ASSIGN(const FilePtr file,
                              MissionFile::Open(dir.File("m")));
  EXPECT_EQ(file->metadata(), metadata);
}

TEST(MissionFile, CreateRefusesANameThatIsTaken) {
  const TempDir dir;
  std::ofstream(dir.File("m")) << "precious";
  EXPECT_THAT(MissionFile::Create(dir.File("m"), SampleMetadata()),
              StatusIs(absl::StatusCode::kAlreadyExists));
  EXPECT_EQ(ReadAll(dir.File("m")), "precious");
  EXPECT_THAT(FilesIn(dir), ElementsAre("m"));
}

TEST(MissionFile, CreateRefusesBadMetadata) {
  const TempDir dir;
  MissionMetadata metadata = SampleMetadata();
  metadata.tolerance_m = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(
      MissionFile::Create(dir.File("m"), metadata),
      StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("tolerance_m")));
  metadata = SampleMetadata();
  metadata.name.assign(kMaxNameBytes + 1, 'x');
  EXPECT_THAT(MissionFile::Create(dir.File("m"), metadata),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("name")));
  EXPECT_THAT(FilesIn(dir), IsEmpty());
}

TEST(MissionFile, CleanCloseLeavesOneFile) {
  const TempDir dir;
  FATHOM_ASSERT_OK_AND_ASSIGN(
      FilePtr file, MissionFile::Create(dir.File("m"), SampleMetadata()));
  Batch batch;
  batch.journal.push_back({1, SampleStart("a")});
  ASSERT_THAT(file->Commit(batch), IsOk());
  EXPECT_THAT(file->Close(), IsOk());
  EXPECT_THAT(file->Commit(batch),
              StatusIs(absl::StatusCode::kFailedPrecondition));
  file.reset();
  EXPECT_THAT(FilesIn(dir), ElementsAre("m"));
}

TEST(MissionFile, MissingFileIsNotFoundAndNotMade) {
  const TempDir dir;
  EXPECT_THAT(MissionFile::Open(dir.File("m")),
              StatusIs(absl::StatusCode::kNotFound));
  EXPECT_THAT(FilesIn(dir), IsEmpty());
}

TEST(MissionFile, SecondOpenerIsToldWhoHoldsTheMission) {
  const TempDir dir;
  FATHOM_ASSERT_OK_AND_ASSIGN(
      const FilePtr file, MissionFile::Create(dir.File("m"), SampleMetadata()));
  const auto refused =
      StatusIs(absl::StatusCode::kFailedPrecondition,
               AllOf(HasSubstr("in use"),
                     HasSubstr(absl::StrFormat("process %d", getpid()))));
  EXPECT_THAT(MissionFile::Open(dir.File("m")), refused);
  // By another name for the same file too.
  std::filesystem::create_symlink(dir.File("m"), dir.File("alias"));
  EXPECT_THAT(MissionFile::Open(dir.File("alias")), refused);
  // The holder works on: the refused ones have not dropped its locks.
  Batch batch;
  batch.journal.push_back({1, SampleStart("a")});
  EXPECT_THAT(file->Commit(batch), IsOk());
}

class ForeignFileTest : public ::testing::Test {
 protected:
  // Opening must fail, say so, change no byte and leave nothing beside.
  void ExpectRefusedUntouched(const std::string& reason) {
    const std::string before = ReadAll(path_);
    const std::vector<std::string> files = FilesIn(dir_);
    EXPECT_THAT(MissionFile::Open(path_),
                StatusIs(absl::StatusCode::kFailedPrecondition,
                         AllOf(HasSubstr(reason), HasSubstr("untouched"))));
    EXPECT_TRUE(ReadAll(path_) == before);
    EXPECT_EQ(FilesIn(dir_), files);
  }

  TempDir dir_;
  std::string path_ = dir_.File("m");
};

TEST_F(ForeignFileTest, EmptyFileIsRefused) {
  std::ofstream(path_).flush();
  ExpectRefusedUntouched("not a Fathom mission");
}

TEST_F(ForeignFileTest, TextIsRefused) {
  std::ofstream(path_) << std::string(5000, 'x');
  ExpectRefusedUntouched("not a Fathom mission");
}

TEST_F(ForeignFileTest, AnotherProgramsDatabaseIsRefused) {
  FATHOM_ASSERT_OK_AND_ASSIGN(
      Connection other, Connection::Open(path_, Connection::Mode::kCreate));
  ASSERT_THAT(other.Execute("PRAGMA application_id = 1; CREATE TABLE t (a)"),
              IsOk());
  other = Connection();
  ExpectRefusedUntouched("not a Fathom mission");
}

TEST_F(ForeignFileTest, NewerMissionIsRefused) {
  ASSERT_THAT(MissionFile::Create(path_, SampleMetadata()), IsOk());
  FATHOM_ASSERT_OK_AND_ASSIGN(
      Connection newer, Connection::Open(path_, Connection::Mode::kReadWrite));
  ASSERT_THAT(newer.Execute(absl::StrFormat("PRAGMA user_version = %d",
                                            kSchemaVersion + 1)),
              IsOk());
  ASSERT_THAT(newer.CheckpointTruncate(), IsOk());
  newer.CheckpointOnClose();
  newer = Connection();
  ExpectRefusedUntouched("newer program");
}

TEST_F(ForeignFileTest, NewerMissionWhoseVersionIsStillInTheLogIsRefused) {
  ASSERT_THAT(MissionFile::Create(path_, SampleMetadata()), IsOk());
  FATHOM_ASSERT_OK_AND_ASSIGN(
      Connection newer, Connection::Open(path_, Connection::Mode::kReadWrite));
  ASSERT_THAT(newer.Execute(absl::StrFormat("PRAGMA user_version = %d",
                                            kSchemaVersion + 1)),
              IsOk());
  newer = Connection();  // As if killed: nothing is checkpointed.
  ASSERT_TRUE(std::filesystem::exists(path_ + "-wal"));
  const std::string file = ReadAll(path_);
  const std::string log = ReadAll(path_ + "-wal");
  EXPECT_THAT(MissionFile::Open(path_),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       HasSubstr("newer program")));
  EXPECT_TRUE(ReadAll(path_) == file);
  EXPECT_TRUE(ReadAll(path_ + "-wal") == log);
}

class MissionMapTest : public ::testing::Test {
 protected:
  void SetUp() override {
    auto created = MissionFile::Create(dir_.File("m"), SampleMetadata());
    ASSERT_THAT(created, IsOk());
    file_ = *std::move(created);
    Reopen();
  }

  // Closes, opens, restores: as a server's restart does.
  void Reopen() {
    script_.reset();
    file_.reset();
    auto opened = MissionFile::Open(dir_.File("m"));
    ASSERT_THAT(opened, IsOk());
    file_ = *std::move(opened);
    auto restored = OpenMap(*file_);
    ASSERT_THAT(restored, IsOk());
    EXPECT_EQ(restored->refused_records, 0u);
    map_ = std::move(restored->map);
    script_.emplace(*map_, restored->checkpoint);
  }

  void StepTo(std::uint64_t revision) {
    while (map_->revision() < revision) script_->Step();
  }
  void Commit() {
    ASSERT_THAT(file_->Commit(script_->batch()), IsOk());
    script_->Committed();
  }

  TempDir dir_;
  FilePtr file_;
  std::unique_ptr<map::ObstacleMap> map_;
  std::optional<EventScript> script_;
};

TEST_F(MissionMapTest, JournalAloneGivesTheMapBack) {
  StepTo(39);
  Commit();
  EXPECT_EQ(file_->Status().journal_records, 39u);
  EXPECT_EQ(file_->Status().checkpoint_revision, 0u);
  Reopen();
  EXPECT_EQ(map_->revision(), 39u);
  EXPECT_EQ(map_->View()->Digest(), ScriptDigest(Options(), 39));
  // The digest is not blind: one event less is another map.
  EXPECT_NE(map_->View()->Digest(), ScriptDigest(Options(), 38));
}

TEST_F(MissionMapTest, CheckpointDropsTheJournalItCovers) {
  StepTo(40);  // A transfer: writes tiles, and so all else that changed.
  Commit();
  EXPECT_EQ(file_->Status().journal_records, 0u);
  EXPECT_EQ(file_->Status().checkpoint_revision, 40u);
  FATHOM_ASSERT_OK_AND_ASSIGN(const Loaded loaded, file_->Load());
  EXPECT_THAT(loaded.journal, IsEmpty());
  EXPECT_FALSE(loaded.tiles.empty());
  EXPECT_EQ(loaded.contacts.size(), 2u);
  Reopen();
  EXPECT_EQ(map_->revision(), 40u);
  EXPECT_EQ(map_->View()->Digest(), ScriptDigest(Options(), 40));
}

TEST_F(MissionMapTest, CheckpointPlusJournalGivesTheMapBack) {
  StepTo(40);
  Commit();
  StepTo(60);
  Commit();
  EXPECT_EQ(file_->Status().journal_records, 20u);
  Reopen();
  EXPECT_EQ(map_->View()->Digest(), ScriptDigest(Options(), 60));
}

TEST_F(MissionMapTest, EndedActivityIsListedAndItsBlocksAreGone) {
  StepTo(100);
  Commit();
  FATHOM_ASSERT_OK_AND_ASSIGN(const Loaded loaded, file_->Load());
  ASSERT_EQ(loaded.activities.size(), 1u);
  EXPECT_FALSE(loaded.activities[0].activity.open);
  EXPECT_GT(loaded.activities[0].activity.cells_measured, 0u);
  EXPECT_THAT(loaded.activities[0].blocks, IsEmpty());
  Reopen();
  EXPECT_EQ(map_->View()->Digest(), ScriptDigest(Options(), 100));
}

// Batches, checkpoints and restarts at random places: the map never depends
// on them.
TEST_F(MissionMapTest, AnyBatchingCheckpointingAndRestartingGivesTheSameMap) {
  std::mt19937 random(42);
  while (map_->revision() < 450) {
    StepTo(map_->revision() + 1 + random() % 20);
    if (random() % 4 == 0) script_->Checkpointed();
    Commit();
    if (random() % 5 == 0) {
      const std::uint64_t revision = map_->revision();
      Reopen();
      ASSERT_EQ(map_->revision(), revision);
      ASSERT_EQ(map_->View()->Digest(), ScriptDigest(Options(), revision));
    }
  }
}

TEST_F(MissionMapTest, CheckpointWithoutPreviousWritesEverythingAnew) {
  StepTo(150);
  Commit();
  Batch batch;
  batch.checkpoint = Checkpoint{.now = map_->View(), .previous = nullptr};
  ASSERT_THAT(file_->Commit(batch), IsOk());
  Reopen();
  EXPECT_EQ(map_->View()->Digest(), ScriptDigest(Options(), 150));
}

TEST_F(MissionMapTest, PreviousOfAnotherCheckpointIsRefused) {
  StepTo(30);
  const auto stale = map_->View();
  script_->Checkpointed();
  Commit();
  StepTo(35);
  script_->Checkpointed();
  Commit();
  Batch batch;
  batch.checkpoint = Checkpoint{.now = map_->View(), .previous = stale};
  EXPECT_THAT(file_->Commit(batch),
              StatusIs(absl::StatusCode::kFailedPrecondition));
}

TEST_F(MissionMapTest, RevisionsMustNotFall) {
  StepTo(10);
  Commit();
  Batch batch;
  batch.journal.push_back({9, SampleStart("late")});
  EXPECT_THAT(file_->Commit(batch),
              StatusIs(absl::StatusCode::kInvalidArgument));
}

TEST_F(MissionMapTest, RefusedEventsLeaveTheirRevisionsUnused) {
  StepTo(10);
  // A report with NaN: refused, takes revision 11, is not journalled.
  map::ContactReport bad = SampleReport(1, "bad");
  std::get<map::ContactFix>(bad.observation).position.latitude_deg =
      std::numeric_limits<double>::quiet_NaN();
  ASSERT_FALSE(map_->ApplyContact(bad).applied);
  StepTo(20);
  Commit();
  Reopen();
  EXPECT_EQ(map_->revision(), 20u);
}

TEST_F(MissionMapTest, SourcePositionsComeFromRecordsAndFromRefusals) {
  StepTo(10);  // 1 start, 5 and 10 contacts, else pings: the last ping is 9.
  Batch batch = script_->batch();
  batch.source_positions.push_back({.stream = StreamKind::kPings,
                                    .source = {"refused"},
                                    .epoch = 3,
                                    .sequence = 77});
  // A resend in a later batch takes nothing back.
  batch.source_positions.push_back({.stream = StreamKind::kPings,
                                    .source = {"sonar"},
                                    .epoch = 1,
                                    .sequence = 4});
  ASSERT_THAT(file_->Commit(batch), IsOk());
  FATHOM_ASSERT_OK_AND_ASSIGN(const Loaded loaded, file_->Load());
  EXPECT_THAT(
      loaded.source_positions,
      ElementsAre(SourcePosition{StreamKind::kPings, {"refused"}, 3, 77},
                  SourcePosition{StreamKind::kPings, {"sonar"}, 1, 9},
                  SourcePosition{StreamKind::kContacts, {"c4i"}, 1, 10}));
}

TEST_F(MissionMapTest, ContactHistoryIsReadByTimeRange) {
  StepTo(60);
  Commit();
  // "even" was reported at revisions 10, 20, ..., 60 but 40 (a transfer), at
  // 1e9 + 200 s plus as many seconds.
  const map::ContactKey key{.source = {"c4i"}, .contact = {"even"}};
  const auto at = [](int s) {
    return TimeFromUnixMicros(1'000'000'200'000'000 + s * 1'000'000ll);
  };
  std::vector<std::uint64_t> revisions;
  ASSERT_THAT(
      file_->ReadContactHistory(key, at(20), at(50),
                                [&](const ContactHistoryRow& row) {
                                  EXPECT_EQ(row.estimate.key, key);
                                  EXPECT_EQ(row.estimate.time,
                                            at(static_cast<int>(row.revision)));
                                  revisions.push_back(row.revision);
                                  return true;
                                }),
      IsOk());
  EXPECT_THAT(revisions, ElementsAre(20, 30, 50));
  // What is read is what the map held.
  ASSERT_THAT(file_->ReadContactHistory(
                  key, at(60), at(60),
                  [&](const ContactHistoryRow& row) {
                    EXPECT_EQ(
                        row.estimate,
                        map_->View()->contacts().Find(key)->NewestEstimate());
                    return false;
                  }),
              IsOk());
  EXPECT_THAT(file_->ReadContactHistory(
                  {.source = {"c4i"}, .contact = {"none"}}, at(0), at(60),
                  [](const ContactHistoryRow&) { return true; }),
              StatusIs(absl::StatusCode::kNotFound));
}

TEST_F(MissionMapTest, RevisedHistoryTakesThePlaceOfWhatStoodThere) {
  const map::ContactKey key{.source = {"c4i"}, .contact = {"a"}};
  const auto row = [&key](int s, std::uint64_t revision, bool revises) {
    ContactHistoryRow made{
        .revision = revision, .estimate = {}, .revises = revises};
    static_cast<map::ContactPoint&>(made.estimate) = SampleContactPoint(1);
    made.estimate.key = key;
    made.estimate.time = TimeFromUnixMicros(s * 1'000'000ll);
    return made;
  };
  Batch batch;
  batch.contact_history = {row(10, 1, false), row(20, 2, false),
                           row(30, 3, false)};
  ContactHistoryRow other = row(30, 3, false);
  other.estimate.key.contact.value = "b";
  batch.contact_history.push_back(other);
  // A report of 15 s came as revision 4; the one of 30 s is no more.
  batch.contact_history.push_back(row(10, 4, true));
  batch.contact_history.push_back(row(15, 4, false));
  batch.contact_history.push_back(row(20, 4, false));
  ASSERT_THAT(file_->Commit(batch), IsOk());
  std::vector<std::pair<std::int64_t, std::uint64_t>> rows;
  const auto read = [&](const map::ContactKey& wanted) {
    rows.clear();
    EXPECT_THAT(
        file_->ReadContactHistory(
            wanted, TimeFromUnixMicros(0), TimeFromUnixMicros(100'000'000),
            [&](const ContactHistoryRow& found) {
              rows.push_back({ToUnixMicros(found.estimate.time) / 1'000'000,
                              found.revision});
              return true;
            }),
        IsOk());
  };
  read(key);
  EXPECT_THAT(
      rows, ElementsAre(std::pair(10, 4), std::pair(15, 4), std::pair(20, 4)));
  read(other.estimate.key);
  EXPECT_THAT(rows, ElementsAre(std::pair(30, 3)));
}

TEST_F(MissionMapTest, SavedCopyIsTheMissionAsItWas) {
  StepTo(60);
  Commit();
  FATHOM_ASSERT_OK_AND_ASSIGN(const SavedCopy saved,
                              file_->SaveCopy(dir_.File("copy")));
  EXPECT_EQ(saved.bytes, std::filesystem::file_size(dir_.File("copy")));
  EXPECT_EQ(saved.revision, 60u);
  EXPECT_EQ(saved.digest, ScriptDigest(Options(), 60));
  EXPECT_FALSE(std::filesystem::exists(dir_.File("copy.new-wal")));
  EXPECT_THAT(file_->SaveCopy(dir_.File("copy")),
              StatusIs(absl::StatusCode::kAlreadyExists));
  StepTo(90);
  Commit();
  FATHOM_ASSERT_OK_AND_ASSIGN(const FilePtr copy,
                              MissionFile::Open(dir_.File("copy")));
  FATHOM_ASSERT_OK_AND_ASSIGN(const RestoredMap restored, OpenMap(*copy));
  EXPECT_EQ(restored.map->View()->Digest(), ScriptDigest(Options(), 60));
}

TEST_F(MissionMapTest, DamagedTileIsLeftOutAndTold) {
  StepTo(100);
  Commit();
  file_.reset();
  {
    FATHOM_ASSERT_OK_AND_ASSIGN(
        Connection raw,
        Connection::Open(dir_.File("m"), Connection::Mode::kReadWrite));
    // The last byte of the root tile's blob becomes another.
    ASSERT_THAT(
        raw.Execute("UPDATE tile SET content = CAST(substr(content, 1, "
                    "length(content) - 1) || x'a5' AS BLOB) WHERE tile_key = "
                    "0"),
        IsOk());
  }
  FATHOM_ASSERT_OK_AND_ASSIGN(const FilePtr file,
                              MissionFile::Open(dir_.File("m")));
  FATHOM_ASSERT_OK_AND_ASSIGN(Loaded loaded, file->Load());
  // The tiles below the root's hang on none that can be read.
  ASSERT_THAT(loaded.damage, SizeIs(2));
  EXPECT_THAT(loaded.damage[0], HasSubstr("tile level=0 row=0 col=0"));
  EXPECT_THAT(loaded.damage[1], HasSubstr("hang on none"));
  ASSERT_THAT(loaded.tiles, SizeIs(1));
  FATHOM_ASSERT_OK_AND_ASSIGN(const RestoredMap restored,
                              RestoreMap(std::move(loaded), Options()));
  // Nothing is known there any more; nothing is free.
  EXPECT_EQ(restored.map->View()->global().known_leaf_count(), 0u);

  FATHOM_ASSERT_OK_AND_ASSIGN(const Proof proof, file->Verify());
  EXPECT_THAT(proof.problems, SizeIs(2));
  EXPECT_THAT(file->SaveCopy(dir_.File("copy")),
              StatusIs(absl::StatusCode::kDataLoss,
                       HasSubstr("tile level=0 row=0 col=0")));
  EXPECT_FALSE(std::filesystem::exists(dir_.File("copy")));
}

TEST_F(MissionMapTest, OneDamagedTileAndTheRestServes) {
  StepTo(100);
  Commit();
  const auto known = map_->View()->global().known_leaf_count();
  file_.reset();
  {
    FATHOM_ASSERT_OK_AND_ASSIGN(
        Connection raw,
        Connection::Open(dir_.File("m"), Connection::Mode::kReadWrite));
    ASSERT_THAT(
        raw.Execute("UPDATE tile SET content = x'00' WHERE tile_key = (SELECT "
                    "max(tile_key) FROM tile)"),
        IsOk());
  }
  FATHOM_ASSERT_OK_AND_ASSIGN(const FilePtr file,
                              MissionFile::Open(dir_.File("m")));
  FATHOM_ASSERT_OK_AND_ASSIGN(Loaded loaded, file->Load());
  ASSERT_THAT(loaded.damage, SizeIs(1));
  FATHOM_ASSERT_OK_AND_ASSIGN(const RestoredMap restored,
                              RestoreMap(std::move(loaded), Options()));
  const auto left = restored.map->View()->global().known_leaf_count();
  EXPECT_GT(left, 0u);
  EXPECT_LT(left, known);
}

TEST_F(MissionMapTest, SoundMissionIsProvedWhileItIsWritten) {
  StepTo(70);
  Commit();
  FATHOM_ASSERT_OK_AND_ASSIGN(const Proof proof, file_->Verify());
  EXPECT_THAT(proof.problems, SizeIs(0));
  EXPECT_EQ(proof.revision, 70u);
  EXPECT_EQ(proof.digest, ScriptDigest(Options(), 70));
  EXPECT_EQ(proof.history_rows, 70u / 5 - 70u / 40);  // But for transfers.
  StepTo(80);
  Commit();
}

// One damaged byte, or a file cut short: no crash, and a map that still comes
// back is the right one.
TEST_F(MissionMapTest, DamagedFileNeverCrashesAndNeverGivesAnotherMap) {
  StepTo(130);
  Commit();
  const std::string digest = map_->View()->Digest();
  file_.reset();
  const std::string sound = ReadAll(dir_.File("m"));
  std::mt19937 random(9);
  int refused = 0;
  int left_out = 0;
  for (int trial = 0; trial < 300; ++trial) {
    std::string damaged = sound;
    const std::size_t at = random() % damaged.size();
    damaged[at] ^= static_cast<char>(1 + random() % 255);
    if (trial % 10 == 0) damaged.resize(random() % damaged.size());
    const std::string path = dir_.File("damaged");
    std::ofstream(path, std::ios::binary) << damaged;
    {
      const auto file = MissionFile::Open(path);
      auto loaded = file.ok() ? (*file)->Load() : file.status();
      // Left out and told is not wrong.
      const bool told = loaded.ok() && !loaded->damage.empty();
      const auto restored = loaded.ok()
                                ? RestoreMap(*std::move(loaded), Options())
                                : loaded.status();
      if (restored.ok() && told) {
        ++left_out;
      } else if (restored.ok()) {
        EXPECT_EQ(restored->map->View()->Digest(), digest)
            << "trial " << trial << ", byte " << at;
      } else {
        ++refused;
      }
    }
    for (const char* suffix : {"", "-wal", "-shm"}) {
      std::filesystem::remove(path + suffix);
    }
  }
  EXPECT_GT(left_out, 0);
  EXPECT_GT(refused, 30);  // The thirty that were cut, and some of the rest.
}

}  // namespace
}  // namespace fathom::storage
