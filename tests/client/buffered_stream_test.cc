#include "client/buffered_stream.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "tests/client/failing_sync.h"
#include "tests/client/fake_server.h"
#include "tests/testing/status_matchers.h"

namespace fathom::client {
namespace {

using ::fathom::testing::StatusIs;
using ::testing::HasSubstr;

class BufferedStreamTest : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string name =
        (std::filesystem::path(::testing::TempDir()) / "fathom-buffer.XXXXXX")
            .string();
    folder_ = mkdtemp(name.data());
    auto client = Client::Connect(server_.address(),
                                  {.connect_timeout = std::chrono::seconds(0)});
    FATHOM_ASSERT_OK(client);
    client_ = *std::move(client);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  absl::StatusOr<std::unique_ptr<BufferedPingStream>> Open(
      bool drop_when_full = false,
      std::chrono::milliseconds patience = std::chrono::seconds(30)) {
    IngestStreamOptions options;
    options.source_id = "uuv-1";
    options.epoch = 5;
    options.patience = patience;
    return BufferedPingStream::Open(*client_, options,
                                    {.folder = folder_,
                                     .max_bytes = kLeastSpoolBytes,
                                     .drop_when_full = drop_when_full});
  }

  // A ping of some 1.6 kB.
  static v1::Ping MakePing() {
    v1::Ping ping;
    ping.set_activity_id("survey");
    for (int beam = 0; beam < 101; ++beam) {
      ping.add_range_m(50);
      ping.add_bearing_deg(0);
      ping.add_depth_m(20);
      ping.add_std_m(1);
    }
    return ping;
  }

  void Send(BufferedPingStream& stream, int pings) {
    v1::Ping ping = MakePing();
    for (int i = 0; i < pings; ++i) {
      FATHOM_ASSERT_OK_AND_ASSIGN(const bool taken, stream.Send(ping));
      ASSERT_TRUE(taken);
    }
  }

  // Sends until there is no room for one more; the server must be away. How
  // many that were.
  static std::uint64_t Fill(BufferedPingStream& stream) {
    v1::Ping ping = MakePing();
    const std::uint64_t one = ping.ByteSizeLong() + 300;
    while (stream.state().bytes + one <= kLeastSpoolBytes) {
      FATHOM_EXPECT_OK(stream.Send(ping));
    }
    // Those that are too small for the room of another ping.
    ping.clear_range_m();
    ping.clear_bearing_deg();
    ping.clear_depth_m();
    ping.clear_std_m();
    const std::uint64_t small = ping.ByteSizeLong() + 300;
    while (stream.state().bytes + small <= kLeastSpoolBytes) {
      FATHOM_EXPECT_OK(stream.Send(ping));
    }
    return stream.state().waiting;
  }

  void ExpectEachOnce(std::uint64_t last) {
    for (std::uint64_t number = 1; number <= last; ++number) {
      ASSERT_EQ(server_.pings.times_applied(number), 1) << number;
    }
    EXPECT_EQ(server_.pings.times_applied(last + 1), 0);
  }

  std::string folder_;
  FakeServer server_;
  std::unique_ptr<Client> client_;
};

TEST_F(BufferedStreamTest, EverythingArrivesOnce) {
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto stream, Open());
  Send(*stream, 3000);
  FATHOM_ASSERT_OK(stream->Finish());
  ExpectEachOnce(3000);
  EXPECT_EQ(stream->state().waiting, 0u);
  EXPECT_EQ(stream->progress().durable_sequence, 3000u);
  v1::Ping ping = MakePing();
  EXPECT_THAT(stream->Send(ping).status(),
              StatusIs(absl::StatusCode::kFailedPrecondition));
}

TEST_F(BufferedStreamTest, TheServerMayBeAwayAtTheStartAndInBetween) {
  server_.Stop();
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto stream, Open());
  Send(*stream, 100);
  EXPECT_EQ(stream->state().waiting, 100u);
  server_.Start();
  Send(*stream, 100);
  server_.pings.CutAfter(50, grpc::Status(grpc::StatusCode::UNAVAILABLE, "cut"),
                         /*lose_applied=*/true);
  Send(*stream, 300);
  FATHOM_ASSERT_OK(stream->Finish());
  EXPECT_EQ(server_.pings.durable(), 500u);
  EXPECT_TRUE(stream->progress().gaps.empty());
}

TEST_F(BufferedStreamTest, WhatOneProcessLeftTheNextOneSends) {
  server_.Stop();
  {
    FATHOM_ASSERT_OK_AND_ASSIGN(const auto stream,
                                Open(false, std::chrono::milliseconds(300)));
    Send(*stream, 70);
    EXPECT_THAT(stream->Finish(), StatusIs(absl::StatusCode::kUnavailable,
                                           HasSubstr("holds 70 messages")));
  }
  server_.Start();
  {
    FATHOM_ASSERT_OK_AND_ASSIGN(const auto stream, Open());
    EXPECT_EQ(stream->state().last_before, 70u);
    Send(*stream, 30);
    FATHOM_ASSERT_OK(stream->Finish());
  }
  ExpectEachOnce(100);
  // And nothing is sent a second time.
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto stream, Open());
  EXPECT_EQ(stream->state().waiting, 0u);
  FATHOM_ASSERT_OK(stream->Finish());
  EXPECT_EQ(server_.pings.messages_received(), 100u);
}

TEST_F(BufferedStreamTest, AFullBufferDropsWhatIsNewAndCountsIt) {
  server_.Stop();
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto stream, Open(true));
  v1::Ping ping = MakePing();
  std::uint64_t taken = 0;
  std::uint64_t dropped = 0;
  while (dropped < 10) {
    FATHOM_ASSERT_OK_AND_ASSIGN(const bool went, stream->Send(ping));
    ++(went ? taken : dropped);
  }
  EXPECT_EQ(stream->state().dropped, 10u);
  EXPECT_LE(stream->state().bytes, kLeastSpoolBytes);
  server_.Start();
  FATHOM_ASSERT_OK(stream->Finish());
  ExpectEachOnce(taken);
}

TEST_F(BufferedStreamTest, OrWaitsForRoomAndThenGivesUp) {
  server_.Stop();
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto stream,
                              Open(false, std::chrono::milliseconds(300)));
  v1::Ping ping = MakePing();
  std::uint64_t taken = 0;
  absl::Status end;
  while ((end = stream->Send(ping).status()).ok()) ++taken;
  EXPECT_THAT(end, StatusIs(absl::StatusCode::kUnavailable));
  EXPECT_EQ(stream->state().dropped, 0u);
  EXPECT_EQ(stream->state().waiting, taken);
}

TEST_F(BufferedStreamTest, WhatAPowerCutWouldTakeBackIsNotSent) {
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto stream, Open());
  const FailingSync failing;
  Send(*stream, 1);
  EXPECT_THAT(stream->Finish(), StatusIs(absl::StatusCode::kDataLoss));
  EXPECT_EQ(server_.pings.messages_received(), 0u);
}

TEST_F(BufferedStreamTest, SendersThatWaitForRoomDoNotShareANumber) {
  server_.Stop();
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto stream, Open());
  const std::uint64_t full = Fill(*stream);
  std::vector<std::thread> senders;
  for (int i = 0; i < 4; ++i) {
    senders.emplace_back([&] { Send(*stream, 5); });
  }
  // What they do before the server comes changes nothing but the proof.
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  server_.Start();
  for (std::thread& sender : senders) sender.join();
  FATHOM_ASSERT_OK(stream->Finish());
  ExpectEachOnce(full + 20);
}

TEST_F(BufferedStreamTest, ASenderThatWaitsForRoomLearnsOfTheEnd) {
  server_.Stop();
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto stream, Open());
  const std::uint64_t full = Fill(*stream);
  std::thread sender([&] {
    v1::Ping ping = MakePing();
    EXPECT_THAT(stream->Send(ping).status(),
                StatusIs(absl::StatusCode::kFailedPrecondition));
  });
  std::thread finisher([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    FATHOM_EXPECT_OK(stream->Finish());
  });
  sender.join();
  server_.Start();
  finisher.join();
  ExpectEachOnce(full);
}

// The mission is repaired and served anew; what it has not is sent again.
TEST_F(BufferedStreamTest, ADamagedMissionIsWaitedFor) {
  server_.pings.CutAfter(
      10, grpc::Status(grpc::StatusCode::DATA_LOSS, "page 7"), false);
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto stream, Open());
  Send(*stream, 20);
  FATHOM_ASSERT_OK(stream->Finish());
  ExpectEachOnce(20);
}

TEST_F(BufferedStreamTest, WhatNoPatienceMendsEndsIt) {
  server_.pings.CutAfter(
      10, grpc::Status(grpc::StatusCode::INVALID_ARGUMENT, "no such thing"),
      false);
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto stream, Open());
  v1::Ping ping = MakePing();
  // The end may come before the last of them.
  for (int i = 0; i < 20; ++i) (void)stream->Send(ping);
  EXPECT_THAT(stream->Finish(), StatusIs(absl::StatusCode::kInvalidArgument,
                                         HasSubstr("no such thing")));
  EXPECT_FALSE(stream->Send(ping).ok());
}

}  // namespace
}  // namespace fathom::client
