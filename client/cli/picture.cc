#include "client/cli/picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "client/cli/canvas.h"
#include "client/cli/colormap.h"
#include "client/cli/geo_math.h"
#include "client/cli/map_legend.h"
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

// Between two rows of panels.
constexpr double kRowGap = 24;
constexpr std::size_t kMostPanels = 4;
// A known cell whose evidence has no date.
constexpr Color kAgelessColor = {0.74, 0.72, 0.76};

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
  if (input.panels.empty() || input.panels.size() > kMostPanels) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "%d panels: from 1 to %d are drawn", input.panels.size(), kMostPanels));
  }
  const std::size_t cells = input.region.kind.size();
  for (const PanelKind panel : input.panels) {
    if ((panel == PanelKind::kLayer && input.layers.size() != cells) ||
        (panel == PanelKind::kDifference &&
         input.difference_m.size() != cells)) {
      return absl::InvalidArgumentError("a panel came without its values");
    }
  }
  return absl::OkStatus();
}

// Seconds of one unit of age, and its name: the largest that the oldest
// evidence fills twice.
std::pair<double, const char*> AgeUnit(const std::vector<float>& age_s) {
  double oldest = 0;
  for (const float age : age_s) {
    if (std::isfinite(age)) oldest = std::max(oldest, double{age});
  }
  constexpr std::array<std::pair<double, const char*>, 5> kUnits = {
      {{365.25 * 86'400, "years"},
       {86'400, "days"},
       {3'600, "hours"},
       {60, "minutes"},
       {1, "seconds"}}};
  for (const auto& unit : kUnits) {
    if (oldest >= 2 * unit.first) return unit;
  }
  return kUnits.back();
}

class PictureDrawer {
 public:
  PictureDrawer(const PictureInput& input, Canvas& canvas)
      : input_(input),
        region_(input.region),
        canvas_(canvas),
        depth_m_(WaterOnly(region_, region_.depth_m)),
        depth_scale_(ValueScale::Covering(depth_m_, 0.005, 0.995,
                                          ValueScale::Kind::kRoot)) {
    const MetersPerDegree scale =
        MetersPerDegreeAt(region_.north_west.latitude_deg() -
                          region_.latitude_step_deg * region_.rows / 2);
    shade_ = ShadeRelief(
        depth_m_,
        {.rows = region_.rows,
         .columns = region_.columns,
         .north_south_m = region_.latitude_step_deg * scale.latitude,
         .east_west_m = region_.longitude_step_deg * scale.longitude});
  }

  void Draw(PanelKind kind, const Rectangle& frame) {
    MapPanel panel(canvas_, region_, frame);
    const Rectangle bar{frame.x, frame.y + frame.height + kBelowPanel + 14,
                        frame.width, kBarHeight};
    switch (kind) {
      case PanelKind::kDepth:
        DrawDepth(panel, bar);
        break;
      case PanelKind::kStd:
        DrawStd(panel, bar);
        break;
      case PanelKind::kAge:
        DrawAge(panel, bar);
        break;
      case PanelKind::kLayer:
        DrawLayers(panel, bar);
        break;
      case PanelKind::kDifference:
        DrawDifference(panel, bar);
        break;
    }
    panel.DrawScaleBar();
    panel.DrawNorthArrow();
  }

 private:
  void DrawDepth(MapPanel& panel, const Rectangle& bar) {
    const Colormap colors = Colormap::Depth();
    panel.DrawCells([&](std::size_t i, Color* color) {
      if (!std::isfinite(depth_m_[i])) return false;
      *color = colors.At(depth_scale_.Place(depth_m_[i]), shade_[i]);
      return true;
    });
    panel.DrawContours(depth_m_, depth_scale_.Ticks(8));
    panel.DrawGraticule();
    panel.DrawContourLabels();
    panel.DrawTrack(input_.track);
    panel.DrawContacts(input_.contacts);
    DrawColorBar(
        canvas_, bar, colors, depth_scale_,
        absl::StrFormat(
            "Depth below %s, metres (relief lit from the north-west)",
            input_.vertical_datum.empty() ? "datum" : input_.vertical_datum));
  }

  void DrawStd(MapPanel& panel, const Rectangle& bar) {
    const std::vector<float> std_m = WaterOnly(region_, region_.std_m);
    const ValueScale scale =
        ValueScale::Covering(std_m, 0.01, 0.99, ValueScale::Kind::kLogarithmic);
    const Colormap colors = Colormap::Std();
    panel.DrawCells([&](std::size_t i, Color* color) {
      if (!std::isfinite(std_m[i])) return false;
      *color = colors.At(scale.Place(std_m[i]));
      return true;
    });
    panel.DrawGraticule();
    DrawColorBar(canvas_, bar, colors, scale,
                 "Uncertainty of the depth, 1σ, metres");
  }

  void DrawAge(MapPanel& panel, const Rectangle& bar) {
    std::vector<float> age = WaterOnly(region_, region_.age_s);
    const auto [unit_s, unit] = AgeUnit(age);
    for (float& value : age) value /= static_cast<float>(unit_s);
    const ValueScale scale =
        ValueScale::Covering(age, 0.0, 0.99, ValueScale::Kind::kLogarithmic);
    const Colormap colors = Colormap::Age();
    bool any_without = false;
    panel.DrawCells([&](std::size_t i, Color* color) {
      if (!std::isfinite(depth_m_[i])) return false;
      const bool stated = std::isfinite(age[i]);
      any_without = any_without || !stated;
      *color =
          stated ? colors.At(scale.Place(age[i]), shade_[i]) : kAgelessColor;
      return true;
    });
    panel.DrawGraticule();
    const std::string caption =
        absl::StrFormat("Age of the newest evidence, %s", unit);
    DrawColorBar(canvas_, bar, colors, scale, caption);
    if (any_without) {
      const double x =
          bar.x + canvas_.TextWidth(caption, {.size = 13, .bold = true}) + 24;
      DrawKeyBox(canvas_, x, bar.y - 12, kAgelessColor,
                 "a chart without a date");
    }
  }

  void DrawLayers(MapPanel& panel, const Rectangle& bar) {
    std::array<std::size_t, 6> counts{};
    panel.DrawCells([&](std::size_t i, Color* color) {
      const auto layer = static_cast<std::size_t>(input_.layers[i]);
      if (layer >= counts.size()) return false;
      ++counts[layer];
      const std::optional<Color> plain = LayerColor(input_.layers[i]);
      if (!plain.has_value()) return false;
      OkLab lab = ToOkLab(*plain);
      lab.lightness = std::min(1.0, lab.lightness * double{shade_[i]});
      *color = FromOkLab(lab);
      return true;
    });
    panel.DrawGraticule();
    canvas_.Text("What stands behind each cell (share of the known sea floor)",
                 bar.x, bar.y - 7, {.size = 13, .bold = true});
    std::size_t known = 0;
    for (const CellLayer layer : kKeyLayers) {
      known += counts[static_cast<std::size_t>(layer)];
    }
    double x = bar.x;
    double y = bar.y + 12;
    for (const CellLayer layer : kKeyLayers) {
      const std::size_t count = counts[static_cast<std::size_t>(layer)];
      const std::string text = absl::StrFormat(
          "%s %.3g %%", LayerName(layer),
          known == 0
              ? 0.0
              : 100 * static_cast<double>(count) / static_cast<double>(known));
      if (x > bar.x && x + KeyBoxWidth(canvas_, text) > bar.x + bar.width) {
        x = bar.x;
        y += 22;
      }
      x = DrawKeyBox(canvas_, x, y, *LayerColor(layer), text);
    }
  }

  void DrawDifference(MapPanel& panel, const Rectangle& bar) {
    const std::vector<float> difference =
        WaterOnly(region_, input_.difference_m);
    std::vector<float> sizes;
    double sum = 0;
    double squares = 0;
    for (const float value : difference) {
      if (!std::isfinite(value)) continue;
      sizes.push_back(std::abs(value));
      sum += value;
      squares += double{value} * value;
    }
    const double high =
        sizes.empty()
            ? 1.0
            : std::max(0.01, ValueScale::Covering(sizes, 0, 0.99,
                                                  ValueScale::Kind::kLinear)
                                 .high());
    const ValueScale scale(-high, high, ValueScale::Kind::kLinear);
    const Colormap colors = Colormap::Difference();
    panel.DrawCells([&](std::size_t i, Color* color) {
      if (!std::isfinite(difference[i])) return false;
      *color = colors.At(scale.Place(difference[i]));
      return true;
    });
    panel.DrawContours(depth_m_, depth_scale_.Ticks(8));
    panel.DrawGraticule();
    panel.DrawContourLabels();
    std::string caption = absl::StrFormat(
        "Depth less that of %s, metres: orange shoaler, blue deeper",
        input_.against);
    if (!sizes.empty()) {
      const auto n = static_cast<double>(sizes.size());
      absl::StrAppendFormat(&caption, "  (mean %+.2f, rms %.2f)", sum / n,
                            std::sqrt(squares / n));
    }
    DrawColorBar(canvas_, bar, colors, scale, caption);
  }

  const PictureInput& input_;
  const Region& region_;
  Canvas& canvas_;
  const std::vector<float> depth_m_;
  const ValueScale depth_scale_;
  std::vector<float> shade_;
};

}  // namespace

absl::Status DrawPicture(const PictureInput& input, const std::string& path) {
  const double shape = MapPanel::HeightPerWidth(input.region);
  FATHOM_RETURN_IF_ERROR(Validate(input, shape));
  const std::size_t columns = input.panels.size() == 1 ? 1 : 2;
  const std::size_t rows = (input.panels.size() + columns - 1) / columns;
  const auto wide = static_cast<double>(columns);
  const double panel_width =
      (input.width_px - 2 * kMargin - (wide - 1) * kGap - wide * kLeftLabels) /
      wide;
  const double panel_height = panel_width * shape;
  const double block = panel_height + kBelowPanel + kBarBlock;
  const double height = kTitleHeight + static_cast<double>(rows) * block +
                        static_cast<double>(rows - 1) * kRowGap + kKeyBlock +
                        kMargin / 2;
  if (height > kMaxPictureSide) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "the picture would be %.0f pixels high: choose a smaller width_px "
        "than %d",
        height, input.width_px));
  }
  Canvas canvas(input.width_px, static_cast<int>(std::ceil(height)));
  canvas.Text(input.title, kMargin, 42, {.size = 26, .bold = true});
  canvas.Text(input.subtitle, kMargin, 66, {.size = 14, .color = kGrey});
  PictureDrawer drawer(input, canvas);
  for (std::size_t i = 0; i < input.panels.size(); ++i) {
    const std::size_t panel_row = i / columns;
    const auto column = static_cast<double>(i % columns);
    const auto row = static_cast<double>(panel_row);
    drawer.Draw(
        input.panels[i],
        {kMargin + kLeftLabels + column * (panel_width + kGap + kLeftLabels),
         kTitleHeight + row * (block + kRowGap), panel_width, panel_height});
  }
  DrawKey(canvas, kMargin + kLeftLabels, height - kMargin / 2 - kKeyBlock + 14,
          input);
  return canvas.WritePng(path);
}

}  // namespace fathom::client::cli
