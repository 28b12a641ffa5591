// kill -9 in the middle of commits: every batch that was acknowledged is there
// after, whole, and the map is the one that its events give.
//
// The writer is a forked child that tells each committed revision through a
// pipe. FATHOM_KILL_CYCLES sets how often (default 40).

#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <random>
#include <thread>

#include "storage/mission_file.h"
#include "storage/restore.h"
#include "tests/storage/event_script.h"
#include "tests/storage/sample_records.h"
#include "tests/storage/temp_dir.h"
#include "tests/testing/status_matchers.h"

namespace fathom::storage {
namespace {

using ::fathom::testing::IsOk;

// Opens the mission and commits until it is killed.
[[noreturn]] void RunWriter(const std::string& path, int acks, unsigned seed) {
  auto file = MissionFile::Open(path);
  if (!file.ok()) _exit(2);
  auto loaded = (*file)->Load();
  if (!loaded.ok()) _exit(3);
  auto restored =
      RestoreMap(*std::move(loaded), *OptionsOf((*file)->metadata()));
  if (!restored.ok()) _exit(4);
  EventScript script(*restored->map, restored->checkpoint);
  std::mt19937 random(seed);
  while (true) {
    const unsigned events = 1 + static_cast<unsigned>(random() % 12);
    for (unsigned i = 0; i < events; ++i) script.Step();
    if (random() % 10 == 0) script.Checkpointed();
    if (!(*file)->Commit(script.batch()).ok()) _exit(5);
    script.Committed();
    if (random() % 20 == 0) (*file)->CopyLog().IgnoreError();
    const std::uint64_t revision = restored->map->revision();
    if (write(acks, &revision, sizeof(revision)) != sizeof(revision)) _exit(6);
  }
}

TEST(KillTest, EveryAcknowledgedBatchIsThereAfterKill) {
  const TempDir dir;
  const std::string path = dir.File("m");
  ASSERT_THAT(MissionFile::Create(path, SampleMetadata()), IsOk());
  const map::MissionOptions options = *OptionsOf(SampleMetadata());
  const char* const wanted = std::getenv("FATHOM_KILL_CYCLES");
  const int cycles = wanted != nullptr ? std::atoi(wanted) : 40;

  // The map as it must be, led along behind the file.
  map::ObstacleMap expected(options);
  EventScript expected_script(expected, nullptr);
  std::mt19937 random(123);
  std::uint64_t last = 0;
  for (int cycle = 0; cycle < cycles; ++cycle) {
    int pipe_ends[2];
    ASSERT_EQ(pipe2(pipe_ends, O_CLOEXEC), 0);
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      close(pipe_ends[0]);
      RunWriter(path, pipe_ends[1], static_cast<unsigned>(cycle));
    }
    close(pipe_ends[1]);
    // After some acknowledgements, at an arbitrary moment of the next commit.
    std::uint64_t acknowledged = last;
    std::uint64_t revision = 0;
    for (unsigned left = 1 + static_cast<unsigned>(random() % 25); left > 0;
         --left) {
      ASSERT_EQ(read(pipe_ends[0], &revision, sizeof(revision)),
                static_cast<ssize_t>(sizeof(revision)));
      acknowledged = revision;
    }
    std::this_thread::sleep_for(std::chrono::microseconds(random() % 4000));
    kill(child, SIGKILL);
    int status = 0;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    ASSERT_TRUE(WIFSIGNALED(status)) << "the writer failed: " << status;
    while (read(pipe_ends[0], &revision, sizeof(revision)) ==
           static_cast<ssize_t>(sizeof(revision))) {
      acknowledged = revision;
    }
    close(pipe_ends[0]);

    FATHOM_ASSERT_OK_AND_ASSIGN(const auto file, MissionFile::Open(path));
    FATHOM_ASSERT_OK_AND_ASSIGN(Loaded loaded, file->Load());
    const std::uint64_t durable = loaded.revision;
    EXPECT_GE(durable, acknowledged) << "cycle " << cycle;
    EXPECT_EQ(file->Status().durable_revision, durable);
    // The ledger of sources is that of the same instant: the last ping or
    // report has the number of its revision.
    std::uint64_t newest = 0;
    for (const SourcePosition& position : loaded.source_positions) {
      newest = std::max(newest, position.sequence);
    }
    EXPECT_LE(newest, durable);
    EXPECT_GE(newest + 2, durable);  // Transfers and starts have no number.
    FATHOM_ASSERT_OK_AND_ASSIGN(const RestoredMap restored,
                                RestoreMap(std::move(loaded), options));
    while (expected.revision() < durable) {
      expected_script.Step();
      expected_script.Committed();
    }
    ASSERT_EQ(restored.map->revision(), durable);
    ASSERT_EQ(restored.map->View()->Digest(), expected.View()->Digest())
        << "cycle " << cycle << " revision " << durable;
    last = durable;
  }
  EXPECT_GT(last, static_cast<std::uint64_t>(cycles));
}

}  // namespace
}  // namespace fathom::storage
