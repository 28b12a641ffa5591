#include "server/convert_mission.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "server/limits.h"
#include "server/mission.h"
#include "server/server.h"
#include "tests/server/sample_messages.h"
#include "tests/server/violation_matcher.h"
#include "tests/testing/status_matchers.h"

namespace fathom::server {
namespace {

using ::fathom::testing::IsOk;
using ::fathom::testing::StatusIs;
using ::testing::HasSubstr;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr auto kInvalid = v1::REJECT_REASON_INVALID_MESSAGE;
constexpr auto kNotFinite = v1::REJECT_REASON_NOT_FINITE;
constexpr auto kBadStd = v1::REJECT_REASON_BAD_STD;
constexpr auto kBadDepth = v1::REJECT_REASON_BAD_DEPTH;
constexpr Time kNow = TimeFromUnixMicros(kSampleSeconds * 1'000'000);

template <typename Message>
struct Spoiled {
  const char* path;
  v1::RejectReason reason;
  std::function<void(Message&)> spoil;
};

TEST(ConvertStart, FillsTheDefaultsOfTheContract) {
  v1::StartActivityRequest request = SampleStart();
  request.clear_time();
  FATHOM_ASSERT_OK_AND_ASSIGN(const map::StartActivity event,
                              ConvertStart(request, kNow));
  EXPECT_EQ(event.id.value, "leg-1");
  EXPECT_EQ(event.start, kNow);
  EXPECT_EQ(event.options.estimator, map::EstimatorKind::kAdaptive);
  EXPECT_EQ(event.options.max_range_m, 1000);
  EXPECT_EQ(event.options.north_extent_m, 500);
  EXPECT_EQ(event.options.east_extent_m, 400);
  EXPECT_FALSE(event.options.default_depth_m.has_value());
}

TEST(ConvertStart, NamesEveryBadField) {
  const std::vector<Spoiled<v1::StartActivityRequest>> cases = {
      {"activity_id", kInvalid, [](auto& r) { r.clear_activity_id(); }},
      {"vehicle_id", kInvalid, [](auto& r) { r.set_vehicle_id("a b"); }},
      {"time", kInvalid, [](auto& r) { r.mutable_time()->set_nanos(-1); }},
      {"parameters", kInvalid, [](auto& r) { r.clear_parameters(); }},
      {"parameters.south_west", kInvalid,
       [](auto& r) { r.mutable_parameters()->clear_south_west(); }},
      {"parameters.south_west.longitude_deg", kNotFinite,
       [](auto& r) {
         r.mutable_parameters()->mutable_south_west()->set_longitude_deg(kNaN);
       }},
      {"parameters.north_extent_m", kInvalid,
       [](auto& r) { r.mutable_parameters()->set_north_extent_m(0); }},
      {"parameters.east_extent_m", kInvalid,
       [](auto& r) { r.mutable_parameters()->set_east_extent_m(-5); }},
      {"parameters.cell_size_m", kInvalid,
       [](auto& r) { r.mutable_parameters()->set_cell_size_m(0.05); }},
      {"parameters.cell_size_m", kInvalid,
       [](auto& r) { r.mutable_parameters()->set_cell_size_m(1001); }},
      // 10 000 m / 0.1 m = 100 000 cells a side.
      {"parameters.north_extent_m", kInvalid,
       [](auto& r) {
         r.mutable_parameters()->set_north_extent_m(10'000);
         r.mutable_parameters()->set_cell_size_m(0.1);
       }},
      {"parameters.estimator", kInvalid,
       [](auto& r) {
         r.mutable_parameters()->set_estimator(static_cast<v1::Estimator>(42));
       }},
      {"parameters.min_range_m", kInvalid,
       [](auto& r) { r.mutable_parameters()->set_min_range_m(-1); }},
      {"parameters.max_range_m", kInvalid,
       [](auto& r) {
         r.mutable_parameters()->set_min_range_m(50);
         r.mutable_parameters()->set_max_range_m(50);
       }},
      {"parameters.smoothing_distance_m", kInvalid,
       [](auto& r) { r.mutable_parameters()->set_smoothing_distance_m(-1); }},
      // More than 16 cells of 10 m.
      {"parameters.smoothing_distance_m", kInvalid,
       [](auto& r) { r.mutable_parameters()->set_smoothing_distance_m(161); }},
      {"parameters.smoothing_scale", kInvalid,
       [](auto& r) { r.mutable_parameters()->set_smoothing_scale(1); }},
      {"parameters.default_prior.depth_m", kBadDepth,
       [](auto& r) {
         r.mutable_parameters()->mutable_default_prior()->set_depth_m(-200);
       }},
      {"parameters.default_prior.std_m", kBadStd,
       [](auto& r) {
         r.mutable_parameters()->mutable_default_prior()->set_depth_m(20);
       }},
  };
  for (const auto& spoiled : cases) {
    v1::StartActivityRequest request = SampleStart();
    spoiled.spoil(request);
    EXPECT_THAT(ConvertStart(request, kNow),
                Violates(spoiled.path, spoiled.reason));
  }
}

TEST(ConvertStart, BoundsTheCellsOfOneMap) {
  v1::StartActivityRequest request = SampleStart();
  request.mutable_parameters()->set_cell_size_m(1);
  request.mutable_parameters()->set_north_extent_m(10'000);
  request.mutable_parameters()->set_east_extent_m(10'000);
  EXPECT_THAT(ConvertStart(request, kNow), IsOk());  // 100 M
  request.mutable_parameters()->set_east_extent_m(10'001);
  EXPECT_THAT(ConvertStart(request, kNow),
              StatusIs(absl::StatusCode::kResourceExhausted));
}

TEST(ConvertDrop, NamesEveryBadField) {
  v1::DropContactRequest request;
  EXPECT_THAT(ConvertDrop(request, kNow), Violates("source_id"));
  request.set_source_id("ais");
  EXPECT_THAT(ConvertDrop(request, kNow), Violates("contact_id"));
  request.set_contact_id("MMSI:1");
  FATHOM_ASSERT_OK_AND_ASSIGN(const map::DropContact event,
                              ConvertDrop(request, kNow));
  EXPECT_EQ(event.time, kNow);
  request.mutable_time()->set_seconds(-1);
  EXPECT_THAT(ConvertDrop(request, kNow), Violates("time"));
  // 2090: it would age the whole contact history.
  request.mutable_time()->set_seconds(3'800'000'000);
  EXPECT_THAT(ConvertDrop(request, kNow), Violates("time"));
}

absl::StatusOr<ChartHeader> Header(const v1::PriorHeader& header) {
  const FieldPath root;
  return ConvertHeader(header, FieldPath(root, "header"));
}

TEST(ConvertHeader, NamesEveryBadField) {
  v1::PriorHeader header;
  EXPECT_THAT(Header(header), Violates("header.name"));
  header.set_name("chart\n13221");
  EXPECT_THAT(Header(header), Violates("header.name"));
  header.set_name(std::string(200, 'x'));
  EXPECT_THAT(Header(header), IsOk());
  header.set_name(std::string(201, 'x'));
  EXPECT_THAT(Header(header), Violates("header.name"));
  header.set_name("chart 13221");
  header.mutable_survey_time()->set_seconds(-1);
  EXPECT_THAT(Header(header), Violates("header.survey_time"));
  header.mutable_survey_time()->set_seconds(kSampleSeconds);
  EXPECT_EQ(Header(header)->time_s, kSampleSeconds);
  header.mutable_vertical_reference()->set_reference(
      v1::DEPTH_REFERENCE_WATER_SURFACE);
  EXPECT_THAT(Header(header), Violates("header.vertical_reference.reference"));
  header.clear_vertical_reference();
  header.set_expected_cells(kMaxImportCells + 1);
  EXPECT_THAT(Header(header), StatusIs(absl::StatusCode::kResourceExhausted));
}

TEST(ConvertHeader, AnImportIsNamedAndResumedByName) {
  v1::PriorHeader header;
  header.set_name("chart");
  FATHOM_ASSERT_OK_AND_ASSIGN(const ChartHeader plain, Header(header));
  EXPECT_EQ(plain.import_id, "");
  EXPECT_EQ(plain.first_tile, 1U);
  header.set_first_tile(5);
  EXPECT_THAT(Header(header), Violates("header.first_tile"));
  header.set_import_id("sha256-0a1b2c");
  FATHOM_ASSERT_OK_AND_ASSIGN(const ChartHeader resumed, Header(header));
  EXPECT_EQ(resumed.import_id, "sha256-0a1b2c");
  EXPECT_EQ(resumed.first_tile, 5U);
  header.set_import_id("two words");
  EXPECT_THAT(Header(header), Violates("header.import_id"));
}

absl::StatusOr<map::RasterBlock> Tile(const v1::DepthTile& tile) {
  const FieldPath root;
  return ConvertTile(tile, {.name = "c", .time_s = 7, .replace = true},
                     FieldPath(root, "tile"));
}

TEST(ConvertTile, KeepsEveryCell) {
  v1::DepthTile tile = SampleTile();
  tile.set_depth_m(4, static_cast<float>(kNaN));
  tile.set_land(std::string("\0\1\0\0\0\0", 6));
  FATHOM_ASSERT_OK_AND_ASSIGN(const map::RasterBlock block, Tile(tile));
  EXPECT_EQ(block.rows, 2U);
  EXPECT_EQ(block.columns, 3U);
  ASSERT_EQ(block.depth_m.size(), 6U);
  EXPECT_TRUE(std::isnan(block.depth_m[4]));
  EXPECT_EQ(block.depth_m[5], 20);
  EXPECT_EQ(block.land[1], 1);
  EXPECT_EQ(block.std_m, std::vector<float>{2});
  EXPECT_EQ(block.time_s, 7U);
  EXPECT_TRUE(block.replace);
}

TEST(ConvertTile, NamesEveryBadField) {
  const std::vector<Spoiled<v1::DepthTile>> cases = {
      {"tile.north_west", kInvalid, [](auto& t) { t.clear_north_west(); }},
      {"tile.north_west.latitude_deg", kInvalid,
       [](auto& t) { t.mutable_north_west()->set_latitude_deg(100); }},
      {"tile.latitude_step_deg", kInvalid,
       [](auto& t) { t.set_latitude_step_deg(0); }},
      {"tile.longitude_step_deg", kNotFinite,
       [](auto& t) { t.set_longitude_step_deg(kNaN); }},
      {"tile.rows", kInvalid, [](auto& t) { t.set_rows(0); }},
      {"tile.columns", kInvalid, [](auto& t) { t.set_columns(0); }},
      // 41.6 - 2 x 10 x ... : 2 rows of 10 deg from 80 S reach 100 S.
      {"tile.rows", kInvalid,
       [](auto& t) {
         t.mutable_north_west()->set_latitude_deg(-80);
         t.set_latitude_step_deg(10);
       }},
      {"tile.depth_m", kInvalid, [](auto& t) { t.add_depth_m(1); }},
      {"tile.std_m", kInvalid, [](auto& t) { t.add_std_m(1); }},
      {"tile.std_m", kInvalid, [](auto& t) { t.clear_std_m(); }},
      {"tile.std_m[0]", kBadStd, [](auto& t) { t.set_std_m(0, 0); }},
      {"tile.std_m[0]", kNotFinite,
       [](auto& t) { t.set_std_m(0, static_cast<float>(kNaN)); }},
      {"tile.depth_m[3]", kBadDepth, [](auto& t) { t.set_depth_m(3, 99'999); }},
      {"tile.depth_m[2]", kNotFinite,
       [](auto& t) {
         t.set_depth_m(2, std::numeric_limits<float>::infinity());
       }},
      {"tile.land", kInvalid, [](auto& t) { t.set_land("\1"); }},
      {"tile.land[5]", kInvalid,
       [](auto& t) { t.set_land(std::string("\0\0\0\0\0\2", 6)); }},
  };
  for (const auto& spoiled : cases) {
    v1::DepthTile tile = SampleTile();
    spoiled.spoil(tile);
    EXPECT_THAT(Tile(tile), Violates(spoiled.path, spoiled.reason));
  }
}

TEST(ConvertTile, BoundsTheCellsOfOneTileBeforeItLooksAtThem) {
  v1::DepthTile tile = SampleTile();
  tile.set_rows(0xffffffff);
  tile.set_columns(0xffffffff);
  tile.set_latitude_step_deg(1e-12);
  tile.set_longitude_step_deg(1e-12);
  EXPECT_THAT(Tile(tile), StatusIs(absl::StatusCode::kResourceExhausted));
  tile.set_rows(512);
  tile.set_columns(512);
  tile.mutable_depth_m()->Resize(512 * 512, 20);
  EXPECT_THAT(Tile(tile), IsOk());
  tile.set_rows(513);
  EXPECT_THAT(Tile(tile), StatusIs(absl::StatusCode::kResourceExhausted));
}

TEST(WriteLimits, PublishesEveryLimit) {
  v1::Limits limits;
  WriteLimits(&limits);
  const auto* descriptor = v1::Limits::descriptor();
  for (int i = 0; i < descriptor->field_count(); ++i) {
    EXPECT_GT(limits.GetReflection()->GetUInt64(limits, descriptor->field(i)),
              0U)
        << descriptor->field(i)->name();
  }
}

TEST(ParsePoint, TakesTwoDegreesAndNothingElse) {
  FATHOM_ASSERT_OK_AND_ASSIGN(const map::GeodeticPoint point,
                              ParsePoint("41.5,-71.4"));
  EXPECT_EQ(point.latitude_deg, 41.5);
  EXPECT_EQ(point.longitude_deg, -71.4);
  for (const char* bad : {"", "41.5", "41.5,-71.4,3", "north,west", "91,0",
                          "0,181", "nan,0", "1,inf"}) {
    EXPECT_THAT(ParsePoint(bad), StatusIs(absl::StatusCode::kInvalidArgument))
        << bad;
  }
}

TEST(CheckListenOptions, OnlyLocalAddressesGoWithoutMutualTls) {
  for (const char* local : {"127.0.0.1:0", "127.8.9.1:80", "localhost:7471",
                            "[::1]:7471", "unix:/run/fathomd.sock"}) {
    EXPECT_THAT(CheckListenOptions({.address = local}), IsOk()) << local;
  }
  for (const char* open : {"0.0.0.0:7471", "[::]:7471", "192.168.1.5:7471",
                           "host.example:7471", "127.evil.example:7471"}) {
    EXPECT_THAT(
        CheckListenOptions({.address = open}),
        StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("--tls-cert")))
        << open;
    EXPECT_THAT(CheckListenOptions({.address = open,
                                    .tls_cert = "c",
                                    .tls_key = "k",
                                    .tls_client_ca = "a"}),
                IsOk())
        << open;
  }
  EXPECT_THAT(
      CheckListenOptions({.address = "127.0.0.1:0", .tls_cert = "c"}),
      StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("all of")));
  EXPECT_THAT(CheckListenOptions({.address = "localhost"}),
              StatusIs(absl::StatusCode::kInvalidArgument));
}

}  // namespace
}  // namespace fathom::server
