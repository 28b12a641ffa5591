#include "client/cli/picture.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "client/cli/canvas.h"
#include "client/cli/colormap.h"
#include "client/cli/geo_math.h"
#include "client/cli/map_panel.h"
#include "client/cli/relief_shading.h"
#include "client/cli/value_scale.h"

namespace fathom::client::cli {
namespace {

constexpr double kMargin = 34;
constexpr double kTitleHeight = 92;
constexpr double kLeftLabels = 26;  // Latitudes along each panel.
constexpr double kGap = 34;
constexpr double kBelowPanel = 40;  // Longitudes.
constexpr double kBarHeight = 18;
constexpr double kBarBlock = 66;  // Bar, ticks, caption.
constexpr double kKeyBlock = 40;
// Panels are between these times as high as wide.
constexpr double kMinShape = 0.2;
constexpr double kMaxShape = 1.6;

constexpr Color kGrey = {0.38, 0.41, 0.45};

void DrawColorBar(Canvas& canvas, const Rectangle& bar, const Colormap& colors,
                  const ValueScale& scale, const std::string& caption) {
  for (int i = 0; i < bar.width; ++i) {
    const double x = i;
    canvas.SetColor(colors.At(x / bar.width));
    canvas.Fill({bar.x + x, bar.y, std::min(1.5, bar.width - x), bar.height});
  }
  canvas.SetColor(kFrameColor);
  canvas.Stroke(bar, 1);
  for (const double tick : scale.Ticks(8)) {
    const double x = bar.x + bar.width * scale.Place(tick);
    canvas.SetColor(kFrameColor);
    canvas.Line(x, bar.y + bar.height, x, bar.y + bar.height + 4, 1);
    canvas.Text(ValueScale::TickText(tick), x, bar.y + bar.height + 17,
                {.size = 12, .align = Align::kCenter});
  }
  canvas.Text(caption, bar.x, bar.y - 7, {.size = 13, .bold = true});
}

// The key of symbols, in one line from `x`.
void DrawKey(Canvas& canvas, double x, double y, const PictureInput& input) {
  cairo_t* cairo = canvas.cairo();
  const TextStyle style{.size = 12.5, .color = kGrey};
  const auto label = [&](const std::string& text) {
    canvas.Text(text, x + 34, y + 4, style);
    x += 34 + canvas.TextWidth(text, style) + 26;
  };
  canvas.SetColor(kLandColor);
  canvas.Fill({x, y - 7, 26, 14});
  canvas.SetColor(kShoreColor);
  canvas.Stroke({x, y - 7, 26, 14}, 1);
  label("land");
  canvas.Hatch({x, y - 7, 26, 14});
  canvas.SetColor(kGrey);
  canvas.Stroke({x, y - 7, 26, 14}, 1);
  label("unknown");
  if (!input.track.empty()) {
    canvas.SetColor(kTrackColor);
    canvas.Line(x, y, x + 26, y, 2.2);
    cairo_arc(cairo, x + 26, y, 4, 0, 2 * M_PI);
    cairo_fill(cairo);
    label("vehicle track");
  }
  if (!input.contacts.empty()) {
    canvas.SetColor(kContactColor);
    for (const double half : {1.0, 0.55}) {
      cairo_save(cairo);
      cairo_translate(cairo, x + 13, y);
      cairo_scale(cairo, 13 * half, 8 * half);
      cairo_arc(cairo, 0, 0, 1, 0, 2 * M_PI);
      cairo_restore(cairo);
      cairo_set_line_width(cairo, 1.2);
      cairo_stroke(cairo);
    }
    cairo_arc(cairo, x + 13, y, 2.4, 0, 2 * M_PI);
    cairo_fill(cairo);
    label(
        "contact: 1σ and 2σ ellipses, line = one minute's way; at the frame: "
        "outside");
  }
}

std::vector<float> WaterOnly(const Region& region,
                             const std::vector<float>& values) {
  std::vector<float> water = values;
  for (std::size_t i = 0; i < water.size(); ++i) {
    if (region.kind[i] == v1::EVIDENCE_KIND_LAND) water[i] = std::nanf("");
  }
  return water;
}

absl::Status Validate(const PictureInput& input, double shape) {
  if (input.width_px < 600 || input.width_px > 8000) {
    return absl::InvalidArgumentError(
        absl::StrFormat("width_px=%d: must be in [600, 8000]", input.width_px));
  }
  if (!(shape >= kMinShape && shape <= kMaxShape)) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "the area is %.2g times as high as wide: choose one between %g and "
        "%g",
        shape, kMinShape, kMaxShape));
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status DrawPicture(const PictureInput& input, const std::string& path) {
  const Region& region = input.region;
  const double shape = MapPanel::HeightPerWidth(region);
  FATHOM_RETURN_IF_ERROR(Validate(input, shape));
  const double panel_width =
      (input.width_px - 2 * kMargin - kGap - 2 * kLeftLabels) / 2;
  const double panel_height = panel_width * shape;
  const double height = kTitleHeight + panel_height + kBelowPanel + kBarBlock +
                        kKeyBlock + kMargin / 2;
  Canvas canvas(input.width_px, static_cast<int>(std::ceil(height)));
  canvas.Text(input.title, kMargin, 42, {.size = 26, .bold = true});
  canvas.Text(input.subtitle, kMargin, 66, {.size = 14, .color = kGrey});

  const std::vector<float> depth_m = WaterOnly(region, region.depth_m);
  const std::vector<float> std_m = WaterOnly(region, region.std_m);
  const ValueScale depth_scale =
      ValueScale::Covering(depth_m, 0.005, 0.995, ValueScale::Kind::kRoot);
  const ValueScale std_scale =
      ValueScale::Covering(std_m, 0.01, 0.99, ValueScale::Kind::kLogarithmic);
  const Colormap depth_colors = Colormap::Depth();
  const Colormap std_colors = Colormap::Std();
  const MetersPerDegree scale =
      MetersPerDegreeAt(region.north_west.latitude_deg() -
                        region.latitude_step_deg * region.rows / 2);
  const std::vector<float> shade = ShadeRelief(
      depth_m, {.rows = region.rows,
                .columns = region.columns,
                .north_south_m = region.latitude_step_deg * scale.latitude,
                .east_west_m = region.longitude_step_deg * scale.longitude});

  const Rectangle left{kMargin + kLeftLabels, kTitleHeight, panel_width,
                       panel_height};
  Rectangle right = left;
  right.x += panel_width + kGap + kLeftLabels;

  MapPanel depth_panel(canvas, region, left);
  depth_panel.DrawCells([&](std::size_t i, Color* color) {
    if (!std::isfinite(depth_m[i])) return false;
    *color = depth_colors.At(depth_scale.Place(depth_m[i]), shade[i]);
    return true;
  });
  depth_panel.DrawContours(depth_m, depth_scale.Ticks(8));
  depth_panel.DrawGraticule();
  depth_panel.DrawTrack(input.track);
  depth_panel.DrawContacts(input.contacts);
  depth_panel.DrawScaleBar();
  depth_panel.DrawNorthArrow();

  MapPanel std_panel(canvas, region, right);
  std_panel.DrawCells([&](std::size_t i, Color* color) {
    if (!std::isfinite(std_m[i])) return false;
    *color = std_colors.At(std_scale.Place(std_m[i]));
    return true;
  });
  std_panel.DrawGraticule();
  std_panel.DrawScaleBar();
  std_panel.DrawNorthArrow();

  const double bar_y = kTitleHeight + panel_height + kBelowPanel + 14;
  DrawColorBar(
      canvas, {left.x, bar_y, left.width, kBarHeight}, depth_colors,
      depth_scale,
      absl::StrFormat(
          "Depth below %s, metres (relief lit from the "
          "north-west)",
          input.vertical_datum.empty() ? "datum" : input.vertical_datum));
  DrawColorBar(canvas, {right.x, bar_y, right.width, kBarHeight}, std_colors,
               std_scale, "Uncertainty of the depth, 1σ, metres");
  DrawKey(canvas, left.x, bar_y + kBarBlock, input);
  return canvas.WritePng(path);
}

}  // namespace fathom::client::cli
