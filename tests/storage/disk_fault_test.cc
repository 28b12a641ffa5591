// What the disk is asked to do, and what happens when it refuses.
//
// This program's own fsync, fdatasync and pwrite64 stand before the C
// library's, so that SQLite's calls can be counted and made to fail. They go
// straight to the kernel otherwise.

#include <gtest/gtest.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <climits>
#include <string>

#include "storage/mission_file.h"
#include "storage/restore.h"
#include "storage/sqlite.h"
#include "tests/storage/event_script.h"
#include "tests/storage/sample_records.h"
#include "tests/storage/temp_dir.h"
#include "tests/testing/status_matchers.h"

namespace {

int syncs_of_logs = 0;
int syncs_of_others = 0;
bool fail_syncs = false;
bool disk_full = false;

int Sync(int descriptor, long number) {
  char link[64];
  char path[PATH_MAX];
  std::snprintf(link, sizeof(link), "/proc/self/fd/%d", descriptor);
  const ssize_t size = readlink(link, path, sizeof(path));
  const std::string name(path, size > 0 ? static_cast<std::size_t>(size) : 0);
  if (name.ends_with("-wal")) {
    ++syncs_of_logs;
  } else {
    ++syncs_of_others;
  }
  if (fail_syncs) {
    errno = EIO;
    return -1;
  }
  return static_cast<int>(syscall(number, descriptor));
}

}  // namespace

extern "C" {
int fsync(int descriptor) { return Sync(descriptor, SYS_fsync); }
int fdatasync(int descriptor) { return Sync(descriptor, SYS_fdatasync); }
ssize_t pwrite64(int descriptor, const void* bytes, size_t size,
                 off64_t offset) {
  if (disk_full) {
    errno = ENOSPC;
    return -1;
  }
  return syscall(SYS_pwrite64, descriptor, bytes, size, offset);
}
}

namespace fathom::storage {
namespace {

using ::fathom::testing::IsOk;
using ::fathom::testing::StatusIs;

class DiskFaultTest : public ::testing::Test {
 protected:
  void SetUp() override {
    fail_syncs = false;
    disk_full = false;
    auto created = MissionFile::Create(dir_.File("m"), SampleMetadata());
    ASSERT_THAT(created, IsOk());
    file_ = *std::move(created);
    script_.emplace(map_, nullptr);
  }
  void TearDown() override {
    fail_syncs = false;
    disk_full = false;
  }

  // The digest of the mission as a restart finds it.
  std::string DigestAfterReopen() {
    file_.reset();
    file_ = *MissionFile::Open(dir_.File("m"));
    return RestoreMap(*file_->Load(), options_)->map->View()->Digest();
  }

  TempDir dir_;
  map::MissionOptions options_ = *OptionsOf(SampleMetadata());
  map::ObstacleMap map_{options_};
  std::unique_ptr<MissionFile> file_;
  std::optional<EventScript> script_;
};

TEST_F(DiskFaultTest, EveryCommitSyncsTheLogOnce) {
  for (int i = 0; i < 10; ++i) {
    script_->Step();
    const int before = syncs_of_logs;
    ASSERT_THAT(file_->Commit(script_->batch()), IsOk());
    script_->Committed();
    // The first also syncs the header that begins the log.
    EXPECT_GE(syncs_of_logs - before, 1);
    EXPECT_LE(syncs_of_logs - before, 2);
  }
}

// The negative control: were synchronous switched off, the test above would
// see it.
TEST_F(DiskFaultTest, WithoutSynchronousNothingIsSynced) {
  FATHOM_ASSERT_OK_AND_ASSIGN(
      Connection careless,
      Connection::Open(dir_.File("careless"), Connection::Mode::kCreate));
  ASSERT_THAT(careless.QueryText("PRAGMA journal_mode = WAL"), IsOk());
  ASSERT_THAT(careless.Execute("PRAGMA synchronous = OFF; CREATE TABLE t (a)"),
              IsOk());
  const int before = syncs_of_logs;
  ASSERT_THAT(careless.Execute("INSERT INTO t VALUES (1)"), IsOk());
  EXPECT_EQ(syncs_of_logs, before);
  ASSERT_THAT(careless.Execute("PRAGMA synchronous = FULL"), IsOk());
  ASSERT_THAT(careless.Execute("INSERT INTO t VALUES (1)"), IsOk());
  EXPECT_EQ(syncs_of_logs, before + 1);
}

TEST_F(DiskFaultTest, CommitNeverTouchesTheFileBelowTheLogsLimit) {
  script_->Step();
  ASSERT_THAT(file_->Commit(script_->batch()), IsOk());
  script_->Committed();
  const int before = syncs_of_others;
  for (int i = 0; i < 20; ++i) {
    script_->Step();
    ASSERT_THAT(file_->Commit(script_->batch()), IsOk());
    script_->Committed();
  }
  EXPECT_EQ(syncs_of_others, before);
  ASSERT_THAT(file_->CopyLog(), IsOk());
  EXPECT_GT(syncs_of_others, before);
}

TEST_F(DiskFaultTest, FullDiskRefusesAndTheSameBatchGoesInLater) {
  for (int i = 0; i < 10; ++i) script_->Step();
  ASSERT_THAT(file_->Commit(script_->batch()), IsOk());
  script_->Committed();
  for (int i = 0; i < 60; ++i) script_->Step();
  disk_full = true;
  for (int i = 0; i < 3; ++i) {
    EXPECT_THAT(file_->Commit(script_->batch()),
                StatusIs(absl::StatusCode::kResourceExhausted));
  }
  EXPECT_EQ(file_->Status().durable_revision, 10u);
  disk_full = false;
  EXPECT_THAT(file_->Commit(script_->batch()), IsOk());
  EXPECT_EQ(file_->Status().durable_revision, 70u);
  EXPECT_EQ(DigestAfterReopen(), ScriptDigest(options_, 70));
}

TEST_F(DiskFaultTest, FullDiskThenRestartLosesNothingAcknowledged) {
  for (int i = 0; i < 10; ++i) script_->Step();
  ASSERT_THAT(file_->Commit(script_->batch()), IsOk());
  script_->Committed();
  for (int i = 0; i < 60; ++i) script_->Step();
  disk_full = true;
  EXPECT_THAT(file_->Commit(script_->batch()),
              StatusIs(absl::StatusCode::kResourceExhausted));
  disk_full = false;
  EXPECT_EQ(DigestAfterReopen(), ScriptDigest(options_, 10));
}

TEST_F(DiskFaultTest, FailedSyncIsNeverFollowedByAnAcknowledgement) {
  for (int i = 0; i < 10; ++i) script_->Step();
  ASSERT_THAT(file_->Commit(script_->batch()), IsOk());
  script_->Committed();
  for (int i = 0; i < 5; ++i) script_->Step();
  fail_syncs = true;
  EXPECT_THAT(file_->Commit(script_->batch()),
              StatusIs(absl::StatusCode::kInternal));
  fail_syncs = false;  // A later sync would succeed without having written.
  EXPECT_THAT(file_->Commit(script_->batch()),
              StatusIs(absl::StatusCode::kInternal));
  const std::string digest = DigestAfterReopen();
  EXPECT_TRUE(digest == ScriptDigest(options_, 10) ||
              digest == ScriptDigest(options_, 15));
}

}  // namespace
}  // namespace fathom::storage
