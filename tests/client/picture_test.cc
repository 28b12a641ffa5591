// Pictures: what stands where, read back from the PNG's pixels.

#include "client/cli/picture.h"

#include <cairo/cairo.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>

#include <cmath>
#include <filesystem>

#include "client/cli/colormap.h"
#include "client/cli/contour_lines.h"
#include "client/cli/map_legend.h"
#include "client/cli/map_panel.h"
#include "client/cli/relief_shading.h"
#include "tests/testing/status_matchers.h"

namespace fathom::client::cli {
namespace {

using ::fathom::testing::StatusIs;
using ::testing::HasSubstr;

// 40 x 40 cells of 0.001 degrees: the west half a slope from 5 to 24 m, then
// land, and the last ten columns unknown.
Region MakeRegion() {
  Region region;
  region.rows = region.columns = 40;
  region.north_west.set_latitude_deg(0.02);
  region.north_west.set_longitude_deg(10);
  region.latitude_step_deg = region.longitude_step_deg = 0.001;
  const std::size_t cells = 1600;
  region.depth_m.assign(cells, std::nanf(""));
  region.std_m.assign(cells, std::nanf(""));
  region.age_s.assign(cells, std::nanf(""));
  region.shoalest_m.assign(cells, std::nanf(""));
  region.kind.assign(cells, v1::EVIDENCE_KIND_UNSPECIFIED);
  for (std::uint32_t row = 0; row < 40; ++row) {
    for (std::uint32_t column = 0; column < 30; ++column) {
      const std::size_t i = region.Index(row, column);
      if (column < 20) {
        region.depth_m[i] = 5 + static_cast<float>(column);
        region.std_m[i] = 0.5f;
        region.kind[i] = v1::EVIDENCE_KIND_MEASURED;
      } else {
        region.kind[i] = v1::EVIDENCE_KIND_LAND;
      }
    }
  }
  return region;
}

class PictureTest : public ::testing::Test {
 protected:
  PictureTest() {
    folder_ =
        std::filesystem::temp_directory_path() / "fathom_picture_test.XXXXXX";
    mkdtemp(folder_.data());
  }
  ~PictureTest() override {
    cairo_surface_destroy(image_);
    std::filesystem::remove_all(folder_);
  }

  void Draw(const PictureInput& input) {
    const std::string path = folder_ + "/map.png";
    FATHOM_ASSERT_OK(DrawPicture(input, path));
    cairo_surface_destroy(image_);
    image_ = cairo_image_surface_create_from_png(path.c_str());
    ASSERT_EQ(cairo_surface_status(image_), CAIRO_STATUS_SUCCESS);
  }

  // 0xRRGGBB at a place.
  std::uint32_t At(double x, double y) const {
    const unsigned char* data = cairo_image_surface_get_data(image_);
    const auto* line = reinterpret_cast<const std::uint32_t*>(
        data + static_cast<int>(y) * cairo_image_surface_get_stride(image_));
    return line[static_cast<int>(x)] & 0xffffff;
  }

  std::string folder_;
  cairo_surface_t* image_ = nullptr;
};

// Panels of an 1800 pixel picture: left from x = 60, 823 wide, y from 92;
// margins 34, labels 26 and gap 34 (picture.cc).
constexpr double kLeft = 60;
constexpr double kWidth = (1800.0 - 2 * 34 - 34 - 2 * 26) / 2;
constexpr double kTop = 92;

TEST_F(PictureTest, LandIsTanUnknownIsGreyAndDeeperIsDarker) {
  PictureInput input;
  input.region = MakeRegion();
  Draw(input);
  ASSERT_NE(image_, nullptr);
  EXPECT_EQ(cairo_image_surface_get_width(image_), 1800);
  const double y = kTop + 0.31 * kWidth;
  const auto column_x = [](double column) {
    return kLeft + (column + 0.4) / 40 * kWidth;
  };
  // 0.898, 0.839, 0.714 of 255: e5, d6, b6.
  EXPECT_EQ(At(column_x(25), y), 0xe5d6b6u);
  // Grey: red, green and blue within 3 of each other.
  const std::uint32_t unknown = At(column_x(35), y);
  EXPECT_NEAR(static_cast<double>(unknown >> 16 & 0xff),
              static_cast<double>(unknown & 0xff), 5);
  const auto brightness = [&](double column) {
    const std::uint32_t rgb = At(column_x(column), y);
    return (rgb >> 16 & 0xff) + (rgb >> 8 & 0xff) + (rgb & 0xff);
  };
  EXPECT_GT(brightness(2), brightness(10));
  EXPECT_GT(brightness(10), brightness(18));
}

TEST_F(PictureTest, ContactStandsAtItsPlaceWithItsEllipse) {
  PictureInput input;
  input.region = MakeRegion();
  v1::ContactEstimate contact;
  contact.set_contact_id("c");
  // The middle of the region.
  contact.mutable_position()->set_latitude_deg(0);
  contact.mutable_position()->set_longitude_deg(10.02);
  // 1 sigma: 200 m north, 400 m east. 40 cells of 0.001 degrees are 4453 m
  // wide, so 2 sigma east are 800 m = 0.18 of the panel.
  for (const double c : {40'000., 0., 0., 0., 160'000., 0., 0., 1., 0., 1.}) {
    contact.add_covariance(c);
  }
  PictureInput without = input;
  input.contacts.push_back(contact);
  const double x = kLeft + kWidth / 2;
  const double y = kTop + kWidth * MapPanel::HeightPerWidth(input.region) / 2;
  Draw(without);
  const std::uint32_t inside_before = At(x - 0.17 * kWidth, y + 3);
  const std::uint32_t outside_before = At(x - 0.19 * kWidth, y + 3);
  const std::uint32_t north_before = At(x - 6, y - 0.12 * kWidth);
  Draw(input);
  EXPECT_EQ(At(x, y), 0xb81161u);  // 0.72, 0.07, 0.38 of 255, cut off.
  EXPECT_NE(At(x - 0.17 * kWidth, y + 3), inside_before);
  EXPECT_EQ(At(x - 0.19 * kWidth, y + 3), outside_before);
  // 2 sigma north are 400 m = 0.09 of the panel.
  EXPECT_EQ(At(x - 6, y - 0.12 * kWidth), north_before);
}

TEST_F(PictureTest, LayersAgesAndDifferencesHaveTheirColours) {
  PictureInput input;
  input.region = MakeRegion();
  // Columns 0-4 local, 5-9 global, 10-14 smoothed, 15-19 chart; of these the
  // charted have no age.
  for (std::size_t i = 0; i < 1600; ++i) {
    const std::size_t column = i % 40;
    input.layers.push_back(column < 5    ? CellLayer::kLocal
                           : column < 10 ? CellLayer::kGlobal
                           : column < 15 ? CellLayer::kSmoothed
                           : column < 20 ? CellLayer::kPrior
                           : column < 30 ? CellLayer::kLand
                                         : CellLayer::kUnknown);
    if (column < 15) input.region.age_s[i] = static_cast<float>(column) * 3600;
    // Shoaler in the west, deeper in the east, each by up to 2 m.
    input.difference_m.push_back(
        column < 20 ? (static_cast<float>(column) - 9.5f) * 0.2f
                    : std::nanf(""));
    // Flat: no shade.
    if (column < 20) input.region.depth_m[i] = 10;
  }
  input.against = "other.tif";
  input.panels = {PanelKind::kLayer, PanelKind::kAge, PanelKind::kDifference,
                  PanelKind::kDepth};
  Draw(input);
  ASSERT_NE(image_, nullptr);
  const double right = kLeft + kWidth + 34 + 26;
  // Blocks: panel, 40 for longitudes, 66 for the bar, 24 between rows.
  const double shape = MapPanel::HeightPerWidth(input.region);
  const double below = kTop + kWidth * shape + 40 + 66 + 24;
  const auto at = [&](double left, double top, double column) {
    return At(left + (column + 0.5) / 40 * kWidth, top + 0.31 * kWidth);
  };
  const auto near = [](std::uint32_t rgb, const Color& color) {
    return std::abs((rgb >> 16 & 0xff) / 255.0 - color.red) < 0.02 &&
           std::abs((rgb >> 8 & 0xff) / 255.0 - color.green) < 0.02 &&
           std::abs((rgb & 0xff) / 255.0 - color.blue) < 0.02;
  };
  EXPECT_TRUE(near(at(kLeft, kTop, 2), *LayerColor(CellLayer::kLocal)));
  EXPECT_TRUE(near(at(kLeft, kTop, 7), *LayerColor(CellLayer::kGlobal)));
  EXPECT_TRUE(near(at(kLeft, kTop, 12), *LayerColor(CellLayer::kSmoothed)));
  EXPECT_TRUE(near(at(kLeft, kTop, 17), *LayerColor(CellLayer::kPrior)));
  EXPECT_EQ(at(kLeft, kTop, 25), 0xe5d6b6u);  // Land.
  const auto lightness = [](std::uint32_t rgb) {
    return ToOkLab({(rgb >> 16 & 0xff) / 255.0, (rgb >> 8 & 0xff) / 255.0,
                    (rgb & 0xff) / 255.0})
        .lightness;
  };
  // Older is darker; the charted are one grey, not the hatch of the unknown.
  EXPECT_GT(lightness(at(right, kTop, 1)), lightness(at(right, kTop, 8)) + 0.1);
  EXPECT_GT(lightness(at(right, kTop, 8)),
            lightness(at(right, kTop, 13)) + 0.1);
  EXPECT_EQ(at(right, kTop, 16), at(right, kTop, 18));
  EXPECT_NE(at(right, kTop, 16), at(right, kTop, 13));
  // Orange where shoaler, blue where deeper, nearly white between.
  const std::uint32_t shoaler = at(kLeft, below, 1);
  const std::uint32_t deeper = at(kLeft, below, 18);
  EXPECT_GT(shoaler >> 16 & 0xff, (shoaler & 0xff) + 60);
  EXPECT_GT(deeper & 0xff, (deeper >> 16 & 0xff) + 60);
  EXPECT_GT(lightness(at(kLeft, below, 9)), 0.9);
}

TEST_F(PictureTest, PanelsWithoutValuesAndTooManyAreRefused) {
  PictureInput input;
  input.region = MakeRegion();
  input.panels = {PanelKind::kLayer};
  EXPECT_THAT(DrawPicture(input, folder_ + "/x.png"),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("without its values")));
  input.panels = {};
  EXPECT_THAT(DrawPicture(input, folder_ + "/x.png"),
              StatusIs(absl::StatusCode::kInvalidArgument));
}

TEST(TraceContour, RampGivesOneStraightLine) {
  // 3 x 4 cells rising by 1 to the east from 0: 1.25 lies a quarter beyond the
  // second middle, at x = 1.5 + 0.25.
  std::vector<float> values;
  for (int i = 0; i < 12; ++i) values.push_back(static_cast<float>(i % 4));
  const std::vector<ContourLine> lines = TraceContour(values, 3, 4, 1.25);
  ASSERT_EQ(lines.size(), 1u);
  ASSERT_EQ(lines[0].points.size(), 3u);
  for (const GridPoint& p : lines[0].points) EXPECT_DOUBLE_EQ(p.x, 1.75);
  EXPECT_DOUBLE_EQ(std::abs(lines[0].points[2].y - lines[0].points[0].y), 2);
}

TEST(TraceContour, HillGivesAClosedLineAndUnknownBreaksIt) {
  std::vector<float> values(25, 0);
  values[12] = 4;
  const std::vector<ContourLine> lines = TraceContour(values, 5, 5, 1);
  ASSERT_EQ(lines.size(), 1u);
  // A diamond of four crossings, three quarters of a cell from the top.
  ASSERT_EQ(lines[0].points.size(), 5u);
  EXPECT_DOUBLE_EQ(lines[0].points[0].x, lines[0].points[4].x);
  EXPECT_DOUBLE_EQ(lines[0].points[0].y, lines[0].points[4].y);
  for (const GridPoint& p : lines[0].points) {
    EXPECT_DOUBLE_EQ(std::abs(p.x - 2.5) + std::abs(p.y - 2.5), 0.75);
  }
  values[6] = std::nanf("");  // North-west of the top.
  const std::vector<ContourLine> open = TraceContour(values, 5, 5, 1);
  ASSERT_EQ(open.size(), 1u);
  EXPECT_EQ(open[0].points.size(), 4u);
  // Two tops that touch in a saddle: each has its own line.
  std::vector<float> saddle(36, 0);
  saddle[14] = saddle[21] = 4;
  EXPECT_EQ(TraceContour(saddle, 6, 6, 1).size(), 1u);
  EXPECT_EQ(TraceContour(saddle, 6, 6, -1).size(), 0u);
}

TEST_F(PictureTest, WrongSizesAndPlacesAreRefused) {
  PictureInput input;
  input.region = MakeRegion();
  input.width_px = 599;
  EXPECT_THAT(
      DrawPicture(input, folder_ + "/x.png"),
      StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("width_px=599")));
  input.width_px = 600;
  EXPECT_THAT(DrawPicture(input, folder_ + "/no/such/folder.png"),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("cannot be written")));
  input.region.latitude_step_deg = 0.01;  // Ten times as high as wide.
  EXPECT_THAT(
      DrawPicture(input, folder_ + "/x.png"),
      StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("as high")));
}

TEST(Colormap, LightnessFallsEvenly) {
  for (const Colormap& map :
       {Colormap::Depth(), Colormap::Std(), Colormap::Age()}) {
    const double step =
        ToOkLab(map.At(0)).lightness - ToOkLab(map.At(0.25)).lightness;
    EXPECT_GT(step, 0.1);
    for (const double t : {0.25, 0.5, 0.75}) {
      // Clamping to the gamut may cost a little.
      EXPECT_NEAR(
          ToOkLab(map.At(t)).lightness - ToOkLab(map.At(t + 0.25)).lightness,
          step, 0.02);
    }
  }
}

TEST(Colormap, OkLabOfWhiteAndBack) {
  EXPECT_NEAR(ToOkLab({1, 1, 1}).lightness, 1, 1e-6);
  const Color color = FromOkLab(ToOkLab({0.2, 0.5, 0.8}));
  EXPECT_NEAR(color.red, 0.2, 1e-6);
  EXPECT_NEAR(color.green, 0.5, 1e-6);
  EXPECT_NEAR(color.blue, 0.8, 1e-6);
}

TEST(ShadeRelief, SlopesTowardsTheLightAreBrighter) {
  // A roof whose ridge runs north to south in column 4: its west side faces
  // the light, its east side lies in the shade.
  const ShadingGrid grid{
      .rows = 5, .columns = 9, .north_south_m = 10, .east_west_m = 10};
  std::vector<float> depth;
  for (int i = 0; i < 45; ++i) {
    depth.push_back(10 + static_cast<float>(std::abs(i % 9 - 4)));
  }
  const std::vector<float> shade = ShadeRelief(depth, grid);
  EXPECT_GT(shade[2 * 9 + 2], 1.02f);
  EXPECT_LT(shade[2 * 9 + 6], 0.95f);
  // Flat: no shade at all.
  const std::vector<float> flat = ShadeRelief(std::vector<float>(45, 7), grid);
  EXPECT_NEAR(flat[2 * 9 + 2], 1, 1e-6);
}

}  // namespace
}  // namespace fathom::client::cli
