#include "client/spool.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "absl/strings/str_format.h"
#include "base/crc32c.h"
#include "base/mutex.h"
#include "tests/client/failing_sync.h"
#include "tests/testing/status_matchers.h"

namespace fathom::client {
namespace {

using ::fathom::testing::StatusIs;
using ::testing::HasSubstr;

class SpoolTest : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string name =
        (std::filesystem::path(::testing::TempDir()) / "fathom-spool.XXXXXX")
            .string();
    folder_ = mkdtemp(name.data());
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  absl::StatusOr<std::unique_ptr<Spool>> Open(
      const std::string& source = "uuv-1", std::uint64_t epoch = 7,
      std::uint64_t max_bytes = kLeastSpoolBytes) {
    return Spool::Open({.folder = folder_,
                        .kind = "pings",
                        .source_id = source,
                        .epoch = epoch,
                        .max_bytes = max_bytes});
  }
  // Its segments are of 8 MiB, the largest there are.
  absl::StatusOr<std::unique_ptr<Spool>> OpenLarge() {
    return Open("uuv-1", 7, 64u << 20);
  }

  std::vector<std::string> Segments() const {
    std::vector<std::string> paths;
    for (const auto& entry : std::filesystem::directory_iterator(folder_)) {
      if (entry.path().extension() == ".spool") {
        paths.push_back(entry.path().string());
      }
    }
    std::sort(paths.begin(), paths.end());
    return paths;
  }

  static std::vector<std::string> ReadAll(Spool& spool) {
    std::vector<std::string> all;
    std::string message;
    for (;;) {
      const absl::StatusOr<bool> read = spool.Read(message);
      FATHOM_EXPECT_OK(read);
      if (!read.ok() || !*read) return all;
      all.push_back(message);
    }
  }

  std::string folder_;
};

TEST_F(SpoolTest, GivesBackInOrderWhatItTookAcrossALife) {
  {
    FATHOM_ASSERT_OK_AND_ASSIGN(const auto spool, Open());
    EXPECT_EQ(spool->last_sequence(), 0u);
    for (const char* text : {"a", "bb", "ccc"}) {
      FATHOM_ASSERT_OK(spool->Append(text));
    }
    EXPECT_EQ(ReadAll(*spool), (std::vector<std::string>{"a", "bb", "ccc"}));
  }
  // Another epoch is asked for: the old one goes on.
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto spool, Open("uuv-1", 9));
  EXPECT_EQ(spool->epoch(), 7u);
  EXPECT_EQ(spool->first_sequence(), 1u);
  EXPECT_EQ(spool->last_sequence(), 3u);
  FATHOM_ASSERT_OK(spool->Append("d"));
  EXPECT_EQ(spool->last_sequence(), 4u);
  EXPECT_EQ(ReadAll(*spool), (std::vector<std::string>{"a", "bb", "ccc", "d"}));
}

TEST_F(SpoolTest, WhatTheServerHasLeavesTheDiskAndTheNumbersGoOn) {
  const std::string message(1 << 20, 'x');
  {
    FATHOM_ASSERT_OK_AND_ASSIGN(const auto spool, Open());
    // Segments of 16 MiB / 8: one message each, for two and their frames are
    // above 2 MiB.
    for (int i = 0; i < 6; ++i) FATHOM_ASSERT_OK(spool->Append(message));
    EXPECT_EQ(Segments().size(), 6u);
    FATHOM_ASSERT_OK(spool->Release(4));
    EXPECT_EQ(Segments().size(), 2u);
    EXPECT_EQ(spool->first_sequence(), 5u);
    EXPECT_EQ(ReadAll(*spool).size(), 2u);
    FATHOM_ASSERT_OK(spool->Release(6));
    // An empty one that knows the number stays: 92 bytes of header.
    EXPECT_EQ(spool->bytes(), 92u);
  }
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto spool, Open());
  EXPECT_EQ(spool->last_sequence(), 6u);
  EXPECT_TRUE(ReadAll(*spool).empty());
  FATHOM_ASSERT_OK(spool->Append("seven"));
  EXPECT_EQ(spool->last_sequence(), 7u);
  FATHOM_ASSERT_OK(spool->Release(7));
  FATHOM_ASSERT_OK(spool->Clear());
  EXPECT_EQ(spool->bytes(), 92u);
}

TEST_F(SpoolTest, TakesWhatFitsAndNotOneMore) {
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto spool, Open());
  const std::string message(1 << 20, 'x');
  int taken = 0;
  while (spool->HasRoom(message.size())) {
    FATHOM_ASSERT_OK(spool->Append(message));
    ++taken;
  }
  // 16 x 1 MiB leave no room for their frames.
  EXPECT_EQ(taken, 15);
  EXPECT_THAT(spool->Append(message),
              StatusIs(absl::StatusCode::kResourceExhausted));
  EXPECT_EQ(spool->last_sequence(), 15u);
  EXPECT_LE(spool->bytes(), kLeastSpoolBytes);
  FATHOM_ASSERT_OK(spool->Release(1));
  FATHOM_EXPECT_OK(spool->Append(message));
}

TEST_F(SpoolTest, ATornEndIsCutOffAndTheRestIsThere) {
  for (const std::string& tail :
       {std::string("\x05\0\0\0", 4), std::string("\x05\0\0\0....ab", 10),
        std::string("\x02\0\0\0....ab", 10), std::string(64, '\0')}) {
    {
      FATHOM_ASSERT_OK_AND_ASSIGN(const auto spool, Open());
      FATHOM_ASSERT_OK(spool->Append("whole"));
    }
    std::ofstream(Segments().back(), std::ios::app | std::ios::binary) << tail;
    FATHOM_ASSERT_OK_AND_ASSIGN(const auto spool, Open());
    FATHOM_ASSERT_OK(spool->Append("next"));
    std::vector<std::string> all = ReadAll(*spool);
    ASSERT_GE(all.size(), 2u);
    EXPECT_EQ(all[all.size() - 2], "whole");
    EXPECT_EQ(all.back(), "next");
    FATHOM_ASSERT_OK(spool->Release(spool->last_sequence()));
  }
  // A segment whose making was cut short holds nothing.
  std::ofstream(folder_ + "/pings-00000000000000000099.spool") << "FTHM";
  FATHOM_EXPECT_OK(Open());
  EXPECT_EQ(Segments().size(), 1u);
}

TEST_F(SpoolTest, DamageOfWhatWasSyncedIsNoTornEnd) {
  {
    FATHOM_ASSERT_OK_AND_ASSIGN(const auto spool, Open());
    for (const char* text : {"first", "second", "third"}) {
      FATHOM_ASSERT_OK(spool->Append(text));
    }
    FATHOM_ASSERT_OK(spool->Sync());
  }
  const std::string path = Segments().back();
  const auto size = std::filesystem::file_size(path);
  // 92 bytes of header, then 8 before each message: its text, its checksum;
  // its size made larger than the file, than a message, and none; and the text
  // of the last, 8 + 5 and 8 + 6 bytes further.
  for (const auto& [at, flip, frame] : {std::array{92 + 8, 1, 92},
                                        {92 + 4, 1, 92},
                                        {92, 64, 92},
                                        {92 + 3, 64, 92},
                                        {92, 5, 92},
                                        {119 + 8, 1, 119}}) {
    std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
    file.seekg(at);
    const int good = file.get();
    file.seekp(at);
    file.put(static_cast<char>(good ^ flip)).flush();
    EXPECT_THAT(
        Open(),
        StatusIs(absl::StatusCode::kDataLoss,
                 HasSubstr(absl::StrFormat("damaged at byte %d", frame))))
        << at;
    EXPECT_EQ(std::filesystem::file_size(path), size);
    file.seekp(at);
    file.put(static_cast<char>(good));
  }
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto spool, Open());
  EXPECT_EQ(ReadAll(*spool).size(), 3u);
}

// A disk writes what was not synced in any order, page by page.
TEST_F(SpoolTest, WhatAPowerCutLeftOfUnsyncedMessagesIsCutOff) {
  {
    FATHOM_ASSERT_OK_AND_ASSIGN(const auto spool, Open());
    FATHOM_ASSERT_OK(spool->Append("synced"));
    FATHOM_ASSERT_OK(spool->Sync());
    for (const char* text : {"lost", "half", "arrived"}) {
      FATHOM_ASSERT_OK(spool->Append(text));
    }
  }
  const std::string path = Segments().back();
  {
    // Behind 92 bytes of header, 8 + 6 of the first and 16 of the mark: the
    // second, and the last two bytes of the third.
    std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(122) << std::string(8 + 4, '\0');
    file.seekp(134 + 8 + 2) << std::string(2, '\0');
  }
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto spool, Open());
  EXPECT_EQ(spool->last_sequence(), 1u);
  FATHOM_ASSERT_OK(spool->Append("next"));
  EXPECT_EQ(ReadAll(*spool), (std::vector<std::string>{"synced", "next"}));
}

// "FTHMSPL1": as today's, with another first word.
TEST_F(SpoolTest, AFileWithoutMarksIsReadAndGoesOn) {
  {
    FATHOM_ASSERT_OK_AND_ASSIGN(const auto spool, Open());
    for (const char* text : {"first", "second"}) {
      FATHOM_ASSERT_OK(spool->Append(text));
    }
  }
  const std::string path = Segments().back();
  {
    std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
    std::array<char, 92> header;
    file.read(header.data(), header.size());
    header[7] = '1';
    const std::uint32_t crc =
        Crc32c({reinterpret_cast<const std::uint8_t*>(header.data()), 92 - 4});
    for (std::size_t i = 0; i < 4; ++i) {
      header[88 + i] = static_cast<char>(crc >> (8 * i));
    }
    file.seekp(0).write(header.data(), header.size());
  }
  {
    FATHOM_ASSERT_OK_AND_ASSIGN(const auto spool, Open());
    FATHOM_ASSERT_OK(spool->Append("third"));
    FATHOM_ASSERT_OK(spool->Sync());
    EXPECT_EQ(ReadAll(*spool),
              (std::vector<std::string>{"first", "second", "third"}));
  }
  // A header, three messages and their frames; no mark.
  EXPECT_EQ(std::filesystem::file_size(path), 92u + 3 * 8 + 5 + 6 + 5);
  // Damage before the last message is no torn end there either.
  {
    std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(92 + 8) << 'F';
  }
  EXPECT_THAT(Open(), StatusIs(absl::StatusCode::kDataLoss,
                               HasSubstr("damaged at byte 92")));
}

TEST_F(SpoolTest, AFileLargerThanAnyOfOursIsNotRead) {
  FATHOM_ASSERT_OK(Open());
  // 1 TiB of holes.
  std::filesystem::resize_file(Segments().back(), std::uintmax_t{1} << 40);
  EXPECT_THAT(Open(), StatusIs(absl::StatusCode::kDataLoss));
}

// A message that comes during a sync has two marks behind it: the sync's, which
// does not cover it, and the next one's.
TEST_F(SpoolTest, MarksStayWithinASegment) {
  // What the last message leaves free: room for a mark, and all but for two.
  for (const std::size_t spare : {16, 16 + 15}) {
    const std::string large(4 << 20, 'x');
    // 92 bytes of header, 8 before each of three.
    const std::string rest((4u << 20) - 92 - 3 * 8 - 1 - spare, 'y');
    {
      FATHOM_ASSERT_OK_AND_ASSIGN(const auto spool, OpenLarge());
      FATHOM_ASSERT_OK(spool->Append(large));
      FATHOM_ASSERT_OK(spool->Append(rest));
      Mutex mutex;
      const MutexLock lock(mutex);
      {
        const DuringSync during([&] {
          const MutexLock inner(mutex);
          FATHOM_EXPECT_OK(spool->Append("z"));
        });
        FATHOM_ASSERT_OK(spool->SyncUnlocked(mutex));
      }
      EXPECT_EQ(spool->synced_sequence(), 2u);
      FATHOM_ASSERT_OK(spool->SyncUnlocked(mutex));
      EXPECT_EQ(spool->synced_sequence(), 3u);
    }
    ASSERT_EQ(Segments().size(), 1u);
    EXPECT_LE(std::filesystem::file_size(Segments().back()), 8u << 20);
    for (int life = 0; life < 2; ++life) {
      FATHOM_ASSERT_OK_AND_ASSIGN(const auto spool, OpenLarge());
      EXPECT_EQ(ReadAll(*spool), (std::vector{large, rest, std::string("z")}));
    }
    EXPECT_LE(std::filesystem::file_size(Segments().back()), 8u << 20);
    std::filesystem::remove(Segments().back());
  }
}

TEST_F(SpoolTest, AFileThatMarksOnceMadeTooLargeIsRead) {
  const std::string large(4 << 20, 'x');
  {
    FATHOM_ASSERT_OK_AND_ASSIGN(const auto spool, OpenLarge());
    FATHOM_ASSERT_OK(spool->Append(large));
    FATHOM_ASSERT_OK(spool->Append(large.substr(92 + 2 * 8 + 16)));
    FATHOM_ASSERT_OK(spool->Sync());
    EXPECT_EQ(spool->bytes(), 8u << 20);
  }
  const std::string path = Segments().back();
  std::string mark(16, '\0');
  std::ifstream(path, std::ios::binary)
      .seekg(-16, std::ios::end)
      .read(mark.data(), 16);
  std::ofstream(path, std::ios::app | std::ios::binary) << mark;
  for (int life = 0; life < 2; ++life) {
    FATHOM_ASSERT_OK_AND_ASSIGN(const auto spool, OpenLarge());
    EXPECT_EQ(ReadAll(*spool).size(), 2u + static_cast<std::size_t>(life));
    FATHOM_ASSERT_OK(spool->Append("next"));
    EXPECT_EQ(Segments().size(), 2u);
  }
}

TEST_F(SpoolTest, StaysWithinItsBytes) {
  {
    FATHOM_ASSERT_OK_AND_ASSIGN(const auto spool, Open());
    // Three headers (that of its segment, and of two to come), 8 before it, and
    // a mark.
    const std::size_t most = kLeastSpoolBytes - 3 * 92 - 8 - 16;
    EXPECT_TRUE(spool->HasRoom(most));
    EXPECT_FALSE(spool->HasRoom(most + 1));
  }
  std::uint64_t bytes = 0;
  {
    FATHOM_ASSERT_OK_AND_ASSIGN(const auto spool, OpenLarge());
    const std::string message(1 << 20, 'x');
    for (int i = 0; i < 17; ++i) FATHOM_ASSERT_OK(spool->Append(message));
    bytes = spool->bytes();
  }
  // With less than there is: not a mark more.
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto spool, Open());
  EXPECT_EQ(spool->bytes(), bytes);
  EXPECT_EQ(spool->synced_sequence(), 17u);
  EXPECT_EQ(ReadAll(*spool).size(), 17u);
}

TEST_F(SpoolTest, ASegmentUnderAnotherNumberIsRefused) {
  FATHOM_ASSERT_OK(Open());
  const std::string first = Segments().back();
  const std::string second = folder_ + "/pings-00000000000000000002.spool";
  // Both say that they begin with message 1.
  std::filesystem::copy(first, second);
  EXPECT_THAT(Open(), StatusIs(absl::StatusCode::kDataLoss,
                               HasSubstr(second + " is damaged at byte 0")));
  std::filesystem::remove(first);
  EXPECT_THAT(Open(), StatusIs(absl::StatusCode::kDataLoss, HasSubstr(second)));
  std::filesystem::rename(second, first);
  FATHOM_EXPECT_OK(Open());
}

// A power cut may spare a file's size and none of its bytes.
TEST_F(SpoolTest, AMakingCutShortToZerosHoldsNothing) {
  const auto make_zeros = [this](int number, std::uintmax_t size) {
    const std::string path =
        absl::StrFormat("%s/pings-%020d.spool", folder_, number);
    std::ofstream(path).close();
    std::filesystem::resize_file(path, size);
    return path;
  };
  make_zeros(1, 92);
  {
    FATHOM_ASSERT_OK_AND_ASSIGN(const auto spool, Open());
    FATHOM_ASSERT_OK(spool->Append("a"));
  }
  make_zeros(2, 92);
  {
    FATHOM_ASSERT_OK_AND_ASSIGN(const auto spool, Open());
    EXPECT_EQ(Segments().size(), 1u);
    EXPECT_EQ(ReadAll(*spool), std::vector<std::string>{"a"});
  }
  // No header is larger, and none but the last is not whole.
  const std::string larger = make_zeros(2, 93);
  EXPECT_THAT(Open(), StatusIs(absl::StatusCode::kDataLoss));
  std::filesystem::remove(larger);
  make_zeros(0, 92);
  EXPECT_THAT(Open(), StatusIs(absl::StatusCode::kDataLoss));
}

TEST_F(SpoolTest, WhatAKilledProcessLeftIsSyncedWhenOpened) {
  {
    FATHOM_ASSERT_OK_AND_ASSIGN(const auto spool, Open());
    FATHOM_ASSERT_OK(spool->Append("dirty"));
    EXPECT_EQ(spool->synced_sequence(), 0u);
  }
  {
    const FailingSync failing;
    EXPECT_THAT(Open(), StatusIs(absl::StatusCode::kDataLoss));
  }
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto spool, Open());
  EXPECT_EQ(spool->synced_sequence(), 1u);
}

TEST_F(SpoolTest, ASyncThatFailedIsNotMendedByTheNext) {
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto spool, Open());
  FATHOM_ASSERT_OK(spool->Append("a"));
  {
    const FailingSync failing;
    EXPECT_THAT(spool->Sync(), StatusIs(absl::StatusCode::kDataLoss));
  }
  EXPECT_THAT(spool->Sync(), StatusIs(absl::StatusCode::kDataLoss));
  EXPECT_THAT(spool->Append("b"), StatusIs(absl::StatusCode::kDataLoss));
  EXPECT_EQ(spool->synced_sequence(), 0u);
}

TEST_F(SpoolTest, ASyncCostsAMarkAndARestartNothing) {
  {
    FATHOM_ASSERT_OK_AND_ASSIGN(const auto spool, Open());
    FATHOM_ASSERT_OK(spool->Append("a"));
  }
  // 92 bytes of header, 8 + 1, and 16 for the sync of Open.
  for (int life = 0; life < 3; ++life) {
    FATHOM_ASSERT_OK_AND_ASSIGN(const auto spool, Open());
    EXPECT_EQ(spool->bytes(), 92u + 9 + 16);
    FATHOM_ASSERT_OK(spool->Sync());
    EXPECT_EQ(spool->bytes(), 92u + 9 + 16);
  }
}

TEST_F(SpoolTest, MakesItsFolderAndThoseAbove) {
  const std::string root = folder_;
  for (const char* below : {"/a/b", "/a/b/c/"}) {
    folder_ = root + below;
    FATHOM_EXPECT_OK(Open());
    EXPECT_EQ(Segments().size(), 1u);
  }
  folder_ = root;
}

TEST_F(SpoolTest, AFewMessagesThatTheServerHasCostNoSegment) {
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto spool, Open());
  const std::string path = Segments().back();
  // A segment is 2 MiB; it is left behind from the half on.
  const std::string message(100 << 10, 'x');
  for (std::uint64_t i = 1; i <= 10; ++i) {
    FATHOM_ASSERT_OK(spool->Append(message));
    FATHOM_ASSERT_OK(spool->Release(i));
    EXPECT_EQ(Segments(), std::vector<std::string>{path});
  }
  FATHOM_ASSERT_OK(spool->Append(message));
  FATHOM_ASSERT_OK(spool->Release(11));
  EXPECT_EQ(spool->bytes(), 92u);
}

TEST_F(SpoolTest, DamageIsRefusedAndChangedByNobody) {
  const std::string message(1 << 20, 'x');
  {
    FATHOM_ASSERT_OK_AND_ASSIGN(const auto spool, Open());
    for (int i = 0; i < 3; ++i) FATHOM_ASSERT_OK(spool->Append(message));
  }
  const std::string path = Segments()[1];
  const auto size = std::filesystem::file_size(path);
  {
    std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(5000);
    file.put('y');
  }
  EXPECT_THAT(Open(), StatusIs(absl::StatusCode::kDataLoss, HasSubstr(path)));
  EXPECT_EQ(std::filesystem::file_size(path), size);
  // One that is missing in the middle.
  std::filesystem::remove(path);
  EXPECT_THAT(Open(), StatusIs(absl::StatusCode::kDataLoss,
                               HasSubstr("begins with message 3")));
}

TEST_F(SpoolTest, IsOneSourcesAndOneProcesss) {
  {
    FATHOM_ASSERT_OK_AND_ASSIGN(const auto spool, Open());
    EXPECT_THAT(Open(), StatusIs(absl::StatusCode::kFailedPrecondition,
                                 HasSubstr("in use")));
  }
  EXPECT_THAT(Open("uuv-2"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("uuv-1")));
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto spool, Open(""));
  EXPECT_EQ(spool->source_id(), "uuv-1");
  EXPECT_THAT(
      Spool::Open({.folder = folder_, .kind = "reports", .source_id = ""}),
      StatusIs(absl::StatusCode::kNotFound));
  EXPECT_THAT(Spool::Open({.folder = folder_,
                           .kind = "x",
                           .source_id = "a",
                           .max_bytes = kLeastSpoolBytes - 1}),
              StatusIs(absl::StatusCode::kInvalidArgument));
}

}  // namespace
}  // namespace fathom::client
