// Client against the fake server: connecting, retries, errors that name the
// field, regions, charts.

#include "client/client.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>

#include "client/errors.h"
#include "client/proto_time.h"
#include "tests/client/fake_server.h"
#include "tests/testing/status_matchers.h"

namespace fathom::client {
namespace {

using ::fathom::testing::IsOk;
using ::fathom::testing::StatusIs;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::SizeIs;

const grpc::Status kAway(grpc::StatusCode::UNAVAILABLE, "draining");

class ClientTest : public ::testing::Test {
 protected:
  void SetUp() override {
    FATHOM_ASSERT_OK_AND_ASSIGN(client_,
                                Client::Connect(server_.address(), {}));
  }

  FakeServer server_;
  std::unique_ptr<Client> client_;
};

TEST_F(ClientTest, ConnectToNobodyIsUnavailableAndNamesTheAddress) {
  const std::string address = server_.address();
  server_.Stop();
  EXPECT_THAT(Client::Connect(
                  address, {.connect_timeout = std::chrono::milliseconds(200)}),
              StatusIs(absl::StatusCode::kUnavailable,
                       AllOf(HasSubstr(address), HasSubstr("200 ms"))));
  EXPECT_THAT(Client::Connect("", {}),
              StatusIs(absl::StatusCode::kInvalidArgument));
}

TEST_F(ClientTest, AskingAgainIsLeftToGrpcUpToFourAttempts) {
  server_.FailNext("QueryObstacle", kMaxAttempts - 1, kAway);
  EXPECT_THAT(client_->QueryObstacle({}), IsOk());
  EXPECT_EQ(server_.calls("QueryObstacle"), kMaxAttempts);
  server_.FailNext("QueryObstacle", kMaxAttempts, kAway);
  EXPECT_THAT(client_->QueryObstacle({}),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr("draining")));
  EXPECT_EQ(server_.calls("QueryObstacle"), 2 * kMaxAttempts);
}

TEST_F(ClientTest, StartActivityIsSentOnce) {
  // A second attempt could find the id used by the first.
  server_.FailNext("StartActivity", 1, kAway);
  EXPECT_THAT(client_->StartActivity({}),
              StatusIs(absl::StatusCode::kUnavailable));
  EXPECT_EQ(server_.calls("StartActivity"), 1);
}

TEST_F(ClientTest, RefusalsAreNotRepeated) {
  server_.FailNext("QueryObstacle", 1, BadField("confidence", "0.4: too low"));
  EXPECT_THAT(client_->QueryObstacle({}),
              StatusIs(absl::StatusCode::kInvalidArgument));
  EXPECT_EQ(server_.calls("QueryObstacle"), 1);
}

TEST_F(ClientTest, ErrorNamesTheFieldsPathAndKeepsTheDetails) {
  server_.FailNext(
      "StartActivity", 1,
      BadField("parameters.south_west.latitude_deg", "91: not in [-90, 90]"));
  const absl::Status status = client_->StartActivity({}).status();
  EXPECT_THAT(status, StatusIs(absl::StatusCode::kInvalidArgument,
                               "the request is not valid "
                               "[parameters.south_west.latitude_deg: 91: not "
                               "in [-90, 90]]"));
  const std::vector<FieldError> fields = FieldErrors(status);
  ASSERT_THAT(fields, SizeIs(1));
  EXPECT_EQ(fields[0].field, "parameters.south_west.latitude_deg");
  EXPECT_EQ(fields[0].description, "91: not in [-90, 90]");
}

TEST_F(ClientTest, RpcThatTheServerLacksIsUnimplemented) {
  EXPECT_THAT(client_->SaveMission({}),
              StatusIs(absl::StatusCode::kUnimplemented));
}

v1::GetRegionResponse Tile(std::uint32_t row, std::uint32_t column,
                           std::uint32_t rows, std::uint32_t columns,
                           float first_depth_m) {
  v1::GetRegionResponse message;
  message.set_total_rows(4);
  message.set_total_columns(3);
  v1::RegionTile& tile = *message.mutable_tile();
  tile.mutable_north_west()->set_latitude_deg(42.0 - 0.1 * row);
  tile.mutable_north_west()->set_longitude_deg(-72.0 + 0.2 * column);
  tile.set_latitude_step_deg(0.1);
  tile.set_longitude_step_deg(0.2);
  tile.set_first_row(row);
  tile.set_first_column(column);
  tile.set_rows(rows);
  tile.set_columns(columns);
  for (std::uint32_t i = 0; i < rows * columns; ++i) {
    tile.add_depth_m(first_depth_m + static_cast<float>(i));
    tile.add_std_m(0.5f);
    tile.mutable_kind()->push_back(v1::EVIDENCE_KIND_PRIOR);
  }
  return message;
}

TEST_F(ClientTest, RegionIsPutTogetherFromTilesInAnyOrder) {
  // 4 x 3 cells: rows 2-3 first, then row 0-1 in two blocks of 2 and 1
  // columns.
  server_.region = {Tile(2, 0, 2, 3, 100), Tile(0, 2, 2, 1, 200),
                    Tile(0, 0, 2, 2, 300)};
  FATHOM_ASSERT_OK_AND_ASSIGN(const Region region, client_->GetRegion({}));
  EXPECT_EQ(region.rows, 4u);
  EXPECT_EQ(region.columns, 3u);
  EXPECT_NEAR(region.north_west.latitude_deg(), 42.0, 1e-12);
  EXPECT_NEAR(region.north_west.longitude_deg(), -72.0, 1e-12);
  EXPECT_THAT(region.depth_m,
              ::testing::ElementsAre(300, 301, 200, 302, 303, 201, 100, 101,
                                     102, 103, 104, 105));
  EXPECT_THAT(region.kind, ::testing::Each(v1::EVIDENCE_KIND_PRIOR));
  // The server sent no ages: unknown.
  EXPECT_TRUE(std::isnan(region.age_s[0]));
}

TEST_F(ClientTest, RegionThatIsNotWholeIsAnError) {
  server_.region = {Tile(2, 0, 2, 3, 100)};
  EXPECT_THAT(client_->GetRegion({}),
              StatusIs(absl::StatusCode::kInternal, HasSubstr("6 of 12")));
}

TEST_F(ClientTest, TileOutsideTheGridIsAnErrorNotAWrite) {
  server_.region = {Tile(3, 0, 2, 3, 100)};
  EXPECT_THAT(client_->GetRegion({}),
              StatusIs(absl::StatusCode::kInternal, HasSubstr("row 3")));
  server_.region = {Tile(0, 0, 4, 3, 100)};
  server_.region[0].mutable_tile()->mutable_depth_m()->RemoveLast();
  EXPECT_THAT(client_->GetRegion({}),
              StatusIs(absl::StatusCode::kInternal, HasSubstr("long")));
}

TEST_F(ClientTest, ChartIsWrittenHeaderFirst) {
  v1::PriorHeader header;
  header.set_name("chart 13221");
  FATHOM_ASSERT_OK_AND_ASSIGN(const std::unique_ptr<PriorWriter> writer,
                              client_->ImportPrior(header));
  v1::DepthTile tile;
  tile.set_rows(1);
  FATHOM_ASSERT_OK(writer->Write(tile));
  FATHOM_ASSERT_OK(writer->Write(tile));
  FATHOM_ASSERT_OK_AND_ASSIGN(const v1::ImportPriorResponse done,
                              writer->Finish());
  EXPECT_EQ(done.tiles(), 2u);
  EXPECT_EQ(server_.header.name(), "chart 13221");
  EXPECT_THAT(writer->Finish(),
              StatusIs(absl::StatusCode::kFailedPrecondition));
}

TEST_F(ClientTest, RefusedChartSaysWhichField) {
  server_.FailNext("ImportPrior", 1, BadField("header.name", "empty"));
  FATHOM_ASSERT_OK_AND_ASSIGN(const std::unique_ptr<PriorWriter> writer,
                              client_->ImportPrior({}));
  EXPECT_THAT(writer->Finish(), StatusIs(absl::StatusCode::kInvalidArgument,
                                         HasSubstr("header.name: empty")));
}

TEST(ProtoTime, KeepsMicrosecondsAlsoBefore1970) {
  // -0.25 s is second -1 and 750 ms.
  const Time before = TimeFromUnixMicros(-250'000);
  EXPECT_EQ(ToProto(before).seconds(), -1);
  EXPECT_EQ(ToProto(before).nanos(), 750'000'000);
  EXPECT_EQ(FromProto(ToProto(before)), before);
  const Time after = TimeFromUnixMicros(1'022'198'400'000'001);
  EXPECT_EQ(FromProto(ToProto(after)), after);
}

}  // namespace
}  // namespace fathom::client
