// PingStream against the fake server: numbering, acks, resumption.

#include "client/ping_stream.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <memory>
#include <thread>

#include "client/client.h"
#include "tests/client/fake_server.h"
#include "tests/testing/status_matchers.h"

namespace fathom::client {
namespace {

using ::fathom::testing::IsOk;
using ::fathom::testing::IsOkAndHolds;
using ::fathom::testing::StatusIs;
using ::testing::HasSubstr;
using ::testing::SizeIs;

const grpc::Status kCut(grpc::StatusCode::UNAVAILABLE, "cut by the test");

class PingStreamTest : public ::testing::Test {
 protected:
  void SetUp() override {
    FATHOM_ASSERT_OK_AND_ASSIGN(client_,
                                Client::Connect(server_.address(), {}));
  }

  std::unique_ptr<PingStream> OpenStream(IngestStreamOptions options = {}) {
    options.source_id = "uuv-1";
    absl::StatusOr<std::unique_ptr<PingStream>> stream =
        client_->OpenPingStream(options);
    EXPECT_THAT(stream, IsOk());
    return *std::move(stream);
  }

  static v1::Ping SmallPing() {
    v1::Ping ping;
    ping.set_activity_id("a");
    ping.add_range_m(10);
    ping.add_bearing_deg(0);
    ping.add_depth_m(5);
    ping.add_std_m(0.1f);
    return ping;
  }

  // Each of 1..count was applied once and no other.
  void ExpectAppliedOnce(std::uint64_t count) {
    for (std::uint64_t i = 1; i <= count; ++i) {
      ASSERT_EQ(server_.pings.times_applied(i), 1) << "sequence " << i;
    }
    EXPECT_EQ(server_.pings.times_applied(count + 1), 0);
  }

  FakeServer server_;
  std::unique_ptr<Client> client_;
};

TEST_F(PingStreamTest, NumbersFromOneAndStampsTheCallersPing) {
  auto stream = OpenStream();
  v1::Ping ping = SmallPing();
  EXPECT_THAT(stream->Send(ping), IsOkAndHolds(1u));
  EXPECT_THAT(stream->Send(ping), IsOkAndHolds(2u));
  EXPECT_EQ(ping.source_id(), "uuv-1");
  EXPECT_EQ(ping.sequence(), 2u);
  // 2020-01-01 in microseconds: the default epoch is the wall clock.
  EXPECT_GT(ping.epoch(), 1'577'836'800'000'000u);
  FATHOM_EXPECT_OK(stream->Finish());
  ExpectAppliedOnce(2);
}

TEST_F(PingStreamTest, FlushReturnsWhenAllIsDurable) {
  auto stream = OpenStream();
  v1::Ping ping = SmallPing();
  for (int i = 0; i < 100; ++i) FATHOM_ASSERT_OK(stream->Send(ping));
  FATHOM_ASSERT_OK(stream->Flush());
  EXPECT_EQ(server_.pings.durable(), 100u);
  const IngestProgress progress = stream->progress();
  EXPECT_EQ(progress.sent_sequence, 100u);
  EXPECT_EQ(progress.durable_sequence, 100u);
  EXPECT_EQ(progress.applied_sequence, 100u);
  EXPECT_EQ(progress.messages_applied, 100u);
  EXPECT_EQ(progress.map_revision, 1100u);
}

TEST_F(PingStreamTest, CutBetweenAcksResendsAndCountsNothingTwice) {
  auto stream = OpenStream();
  v1::Ping ping = SmallPing();
  for (int i = 0; i < 50; ++i) FATHOM_ASSERT_OK(stream->Send(ping));
  FATHOM_ASSERT_OK(stream->Flush());
  // 30 of the next 100 arrive and stay applied; none is acknowledged.
  server_.pings.HoldDurable(true);
  server_.pings.CutAfter(30, kCut, /*lose_applied=*/false);
  for (int i = 0; i < 100; ++i) FATHOM_ASSERT_OK(stream->Send(ping));
  std::thread release([this]() {
    // 50, then 30 to the cut, then the same 30 again.
    server_.pings.AwaitReceived(110);
    server_.pings.HoldDurable(false);
  });
  FATHOM_EXPECT_OK(stream->Finish());
  release.join();
  ExpectAppliedOnce(150);
  const IngestProgress progress = stream->progress();
  EXPECT_EQ(progress.reconnects, 1u);
  // 30 were applied before the cut and came again.
  EXPECT_EQ(progress.messages_duplicate, 30u);
  EXPECT_THAT(progress.gaps, SizeIs(0));
}

TEST_F(PingStreamTest, CrashThatForgetsAppliedPingsLosesNone) {
  auto stream = OpenStream();
  v1::Ping ping = SmallPing();
  server_.pings.HoldDurable(true);
  server_.pings.CutAfter(70, kCut, /*lose_applied=*/true);
  for (int i = 0; i < 100; ++i) FATHOM_ASSERT_OK(stream->Send(ping));
  std::thread release([this]() {
    server_.pings.AwaitReceived(71);
    server_.pings.HoldDurable(false);
  });
  FATHOM_EXPECT_OK(stream->Finish());
  release.join();
  ExpectAppliedOnce(100);
  // 70 before the crash, all 100 after it.
  EXPECT_EQ(server_.pings.messages_received(), 170u);
}

TEST_F(PingStreamTest, SurvivesAServerThatGoesAwayAndComesBack) {
  auto stream = OpenStream();
  v1::Ping ping = SmallPing();
  for (int i = 0; i < 10; ++i) FATHOM_ASSERT_OK(stream->Send(ping));
  FATHOM_ASSERT_OK(stream->Flush());
  server_.Stop();
  std::thread restart([this]() { server_.Start(); });
  for (int i = 0; i < 10; ++i) FATHOM_EXPECT_OK(stream->Send(ping).status());
  FATHOM_EXPECT_OK(stream->Finish());
  restart.join();
  ExpectAppliedOnce(20);
}

TEST_F(PingStreamTest, ManyCutsInARow) {
  auto stream = OpenStream();
  v1::Ping ping = SmallPing();
  for (int round = 1; round <= 8; ++round) {
    server_.pings.CutAfter(7 * round, kCut, /*lose_applied=*/round % 2 == 0);
    for (int i = 0; i < 50; ++i) FATHOM_ASSERT_OK(stream->Send(ping));
  }
  server_.pings.CutAfter(-1, kCut, false);
  FATHOM_ASSERT_OK(stream->Finish());
  ExpectAppliedOnce(400);
}

TEST_F(PingStreamTest, WithoutResumeTheCutIsTheCallersAndReconnectMends) {
  auto stream = OpenStream({.resume = false});
  v1::Ping ping = SmallPing();
  server_.pings.HoldDurable(true);
  server_.pings.CutAfter(3, kCut, /*lose_applied=*/true);
  for (int i = 0; i < 3; ++i) FATHOM_ASSERT_OK(stream->Send(ping));
  EXPECT_THAT(stream->Flush(), StatusIs(absl::StatusCode::kUnavailable,
                                        HasSubstr("cut by the test")));
  EXPECT_THAT(stream->Send(ping), StatusIs(absl::StatusCode::kUnavailable));
  server_.pings.HoldDurable(false);
  FATHOM_ASSERT_OK(stream->Reconnect());
  // The refused Send used up no number.
  EXPECT_THAT(stream->Send(ping), IsOkAndHolds(4u));
  FATHOM_ASSERT_OK(stream->Finish());
  ExpectAppliedOnce(4);
}

TEST_F(PingStreamTest, FullBufferMakesSendWaitAndThenSaySo) {
  auto stream = OpenStream(
      {.max_in_flight = 5, .patience = std::chrono::milliseconds(50)});
  v1::Ping ping = SmallPing();
  server_.pings.HoldDurable(true);
  for (int i = 0; i < 5; ++i) FATHOM_ASSERT_OK(stream->Send(ping));
  EXPECT_THAT(stream->Send(ping), StatusIs(absl::StatusCode::kDeadlineExceeded,
                                           HasSubstr("sent 5")));
  server_.pings.HoldDurable(false);
  EXPECT_THAT(stream->Send(ping), IsOkAndHolds(6u));
  FATHOM_ASSERT_OK(stream->Finish());
  ExpectAppliedOnce(6);
}

TEST_F(PingStreamTest, AnErrorThatResendingCannotMendEndsTheStream) {
  server_.FailNext("StreamPings", 1, BadField("ping.source_id", "changed"));
  auto stream = OpenStream();
  v1::Ping ping = SmallPing();
  // The stream may end before or after it took the ping.
  absl::Status status = stream->Send(ping).status();
  if (status.ok()) status = stream->Flush();
  EXPECT_THAT(status, StatusIs(absl::StatusCode::kInvalidArgument,
                               HasSubstr("ping.source_id: changed")));
  EXPECT_EQ(server_.calls("StreamPings"), 1);
}

TEST_F(PingStreamTest, NoServerForLongerThanPatienceIsTheCutsError) {
  auto stream = OpenStream({.patience = std::chrono::milliseconds(200)});
  server_.Stop();
  v1::Ping ping = SmallPing();
  // The first may still find the old connection; a wait cannot.
  absl::Status status = stream->Send(ping).status();
  if (status.ok()) status = stream->Flush();
  EXPECT_THAT(status, ::testing::AnyOf(StatusIs(absl::StatusCode::kUnavailable),
                                       StatusIs(absl::StatusCode::kCancelled)));
}

TEST_F(PingStreamTest, ContinuesACountThatTheCallerKept) {
  server_.pings.Take(5, 1);  // The server knows numbers 1 and 2 of epoch 5.
  server_.pings.Take(5, 2);
  auto stream = OpenStream({.epoch = 5, .first_sequence = 3});
  v1::Ping ping = SmallPing();
  EXPECT_THAT(stream->Send(ping), IsOkAndHolds(3u));
  FATHOM_ASSERT_OK(stream->Finish());
  EXPECT_EQ(server_.pings.durable(), 3u);
  EXPECT_THAT(stream->progress().gaps, SizeIs(0));
}

TEST_F(PingStreamTest, ReportsGapsThatTheServerFound) {
  auto stream = OpenStream({.epoch = 5, .first_sequence = 4});
  v1::Ping ping = SmallPing();
  FATHOM_ASSERT_OK(stream->Send(ping));
  FATHOM_ASSERT_OK(stream->Flush());
  const IngestProgress progress = stream->progress();
  ASSERT_THAT(progress.gaps, SizeIs(1));
  EXPECT_EQ(progress.gaps[0].first_sequence(), 1u);
  EXPECT_EQ(progress.gaps[0].last_sequence(), 3u);
}

TEST_F(PingStreamTest, SendAfterFinishIsRefused) {
  auto stream = OpenStream();
  FATHOM_ASSERT_OK(stream->Finish());
  FATHOM_ASSERT_OK(stream->Finish());
  v1::Ping ping = SmallPing();
  EXPECT_THAT(stream->Send(ping),
              StatusIs(absl::StatusCode::kFailedPrecondition));
  EXPECT_THAT(stream->Reconnect(),
              StatusIs(absl::StatusCode::kFailedPrecondition));
}

TEST_F(PingStreamTest, BadOptionsAreRefused) {
  EXPECT_THAT(client_->OpenPingStream({.source_id = "no spaces"}),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("source_id=\"no spaces\"")));
  EXPECT_THAT(client_->OpenPingStream({.source_id = std::string(65, 'x')}),
              StatusIs(absl::StatusCode::kInvalidArgument));
  FATHOM_EXPECT_OK(
      client_->OpenPingStream({.source_id = std::string(64, 'x')}).status());
  EXPECT_THAT(client_->OpenPingStream({.source_id = "x", .first_sequence = 0}),
              StatusIs(absl::StatusCode::kInvalidArgument));
}

TEST_F(PingStreamTest, MessageAboveFourMebibytesIsRefusedAndTakesNoNumber) {
  auto stream = OpenStream();
  v1::Ping big = SmallPing();
  for (int i = 0; i < (4 << 20) / 4; ++i) big.add_range_m(1);
  EXPECT_THAT(stream->Send(big),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("bytes")));
  v1::Ping ping = SmallPing();
  EXPECT_THAT(stream->Send(ping), IsOkAndHolds(1u));
}

TEST_F(PingStreamTest, SeveralThreadsShareOneStream) {
  auto stream = OpenStream({.max_in_flight = 16});
  server_.pings.CutAfter(150, kCut, /*lose_applied=*/true);
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&]() {
      v1::Ping ping = SmallPing();
      for (int i = 0; i < 100; ++i) FATHOM_EXPECT_OK(stream->Send(ping));
      FATHOM_EXPECT_OK(stream->Flush());
    });
  }
  for (std::thread& thread : threads) thread.join();
  FATHOM_EXPECT_OK(stream->Finish());
  ExpectAppliedOnce(400);
}

TEST_F(PingStreamTest, ContactStreamResumesAlike) {
  auto opened = client_->OpenContactStream({.source_id = "ais"});
  FATHOM_ASSERT_OK(opened.status());
  ContactStream& stream = **opened;
  server_.contacts.CutAfter(5, kCut, /*lose_applied=*/true);
  v1::ContactReport report;
  report.set_contact_id("c");
  for (int i = 0; i < 20; ++i) FATHOM_ASSERT_OK(stream.Send(report));
  FATHOM_ASSERT_OK(stream.WaitApplied(20));
  FATHOM_ASSERT_OK(stream.Finish());
  EXPECT_EQ(report.source_id(), "ais");
  for (std::uint64_t i = 1; i <= 20; ++i) {
    EXPECT_EQ(server_.contacts.times_applied(i), 1);
  }
}

}  // namespace
}  // namespace fathom::client
