// Many points in parts: in order, once each, with one clock for all.

#include "client/point_questions.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "client/proto_time.h"
#include "tests/client/fake_server.h"
#include "tests/testing/status_matchers.h"

namespace fathom::client {
namespace {

using ::fathom::testing::StatusIs;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;

class PointQuestions : public ::testing::Test {
 protected:
  void SetUp() override {
    FATHOM_ASSERT_OK_AND_ASSIGN(client_,
                                Client::Connect(server_.address(), {}));
  }

  FakeServer server_;
  std::unique_ptr<Client> client_;
};

std::vector<QuestionPoint> Points(int count) {
  std::vector<QuestionPoint> points;
  for (int i = 0; i < count; ++i) {
    points.push_back(
        {.latitude_deg = 41 + 0.01 * i, .longitude_deg = -71, .depth_m = 20});
  }
  return points;
}

TEST_F(PointQuestions, ArePartedAtTheServersLimitAndAnsweredInOrder) {
  server_.mission.mutable_limits()->set_max_points_per_query(4);
  // The fake server answers with the latitude as the depth.
  server_.echo_latitude = true;
  server_.batch_revision = 17;
  FATHOM_ASSERT_OK_AND_ASSIGN(const PointAnswers answers,
                              AskPoints(*client_, {}, Points(10), {}));
  // 10 = 4 + 4 + 2.
  EXPECT_EQ(server_.calls("QueryObstacles"), 3);
  EXPECT_EQ(server_.last_batch.latitude_deg_size(), 2);
  // Later parts ask for a map at least as new.
  EXPECT_EQ(server_.last_batch.min_revision(), 17u);
  ASSERT_THAT(answers.mean_depth_m, SizeIs(10));
  for (int i = 0; i < 10; ++i) {
    const auto at = static_cast<std::size_t>(i);
    EXPECT_FLOAT_EQ(answers.mean_depth_m[at],
                    static_cast<float>(41 + 0.01 * i));
    EXPECT_EQ(answers.state[at], v1::OBSTACLE_STATE_UNCERTAIN);
    EXPECT_TRUE(std::isnan(answers.hazard_m[at]));
  }
  // One contact at the first point of each part: 0, 4, 8.
  std::vector<std::uint32_t> with_contact;
  for (const v1::PointContact& contact : answers.contacts) {
    with_contact.push_back(contact.point_index());
  }
  EXPECT_THAT(with_contact, ElementsAre(0, 4, 8));
  EXPECT_EQ(answers.stamp.map_revision(), 17u);
}

TEST_F(PointQuestions, TimesOfTheirOwnAreOffsetsFromTheCommonOne) {
  const Time base = TimeFromUnixMicros(1'022'198'400'000'000);
  std::vector<QuestionPoint> points = Points(3);
  points[1].time = base + std::chrono::seconds(10);
  points[2].time = base - std::chrono::microseconds(1);
  FATHOM_ASSERT_OK(AskPoints(*client_, {}, points, base).status());
  EXPECT_EQ(FromProto(server_.last_batch.time()), base);
  EXPECT_THAT(server_.last_batch.time_offset_us(),
              ElementsAre(0, 10'000'000, -1));
  // Without any, the server's clock says what now is.
  FATHOM_ASSERT_OK(AskPoints(*client_, {}, Points(1), {}).status());
  EXPECT_FALSE(server_.last_batch.has_time());
  EXPECT_THAT(server_.last_batch.time_offset_us(), SizeIs(0));
}

TEST_F(PointQuestions, NoneAreNotAsked) {
  FATHOM_ASSERT_OK_AND_ASSIGN(const PointAnswers answers,
                              AskPoints(*client_, {}, {}, {}));
  EXPECT_THAT(answers.state, SizeIs(0));
  EXPECT_EQ(server_.calls("QueryObstacles"), 0);
}

TEST_F(PointQuestions, ARefusedPartIsTheWholesError) {
  server_.mission.mutable_limits()->set_max_points_per_query(4);
  server_.FailNext("QueryObstacles", 1, BadField("depth_m", "3: too deep"));
  EXPECT_THAT(AskPoints(*client_, {}, Points(10), {}),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("depth_m: 3: too deep")));
}

}  // namespace
}  // namespace fathom::client
