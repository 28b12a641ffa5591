#include "storage/file_lock.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "absl/strings/str_format.h"
#include "tests/storage/temp_dir.h"
#include "tests/testing/status_matchers.h"

namespace fathom::storage {
namespace {

using ::fathom::testing::IsOk;
using ::fathom::testing::StatusIs;
using ::testing::HasSubstr;

TEST(FileLock, SecondHolderIsToldWhoHoldsIt) {
  const TempDir dir;
  FATHOM_ASSERT_OK_AND_ASSIGN(const FileLock first,
                              FileLock::Acquire(dir.File("m")));
  EXPECT_THAT(FileLock::Acquire(dir.File("m")),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       HasSubstr(absl::StrFormat("process %d", getpid()))));
}

TEST(FileLock, ReleaseLeavesNothingBehindAndLetsTheNextIn) {
  const TempDir dir;
  {
    FATHOM_ASSERT_OK_AND_ASSIGN(const FileLock first,
                                FileLock::Acquire(dir.File("m")));
  }
  EXPECT_FALSE(std::filesystem::exists(dir.File("m.lock")));
  EXPECT_THAT(FileLock::Acquire(dir.File("m")), IsOk());
}

TEST(FileLock, DiesWithItsProcess) {
  const TempDir dir;
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    auto lock = FileLock::Acquire(dir.File("m"));
    _exit(lock.ok() ? 0 : 1);  // No destructor: as if killed.
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  ASSERT_EQ(status, 0);
  ASSERT_TRUE(std::filesystem::exists(dir.File("m.lock")));
  EXPECT_THAT(FileLock::Acquire(dir.File("m")), IsOk());
}

TEST(FileLock, MissingFolderIsAnError) {
  const TempDir dir;
  EXPECT_THAT(FileLock::Acquire(dir.File("absent/m")),
              StatusIs(absl::StatusCode::kNotFound));
}

}  // namespace
}  // namespace fathom::storage
