#include "client/cli/map_legend.h"

#include <algorithm>
#include <cmath>

#include "client/cli/map_panel.h"

namespace fathom::client::cli {

std::optional<Color> LayerColor(CellLayer layer) {
  switch (layer) {
    case CellLayer::kLocal:
      return Color{0.835, 0.369, 0.0};  // Vermillion.
    case CellLayer::kGlobal:
      return Color{0.0, 0.447, 0.698};  // Blue.
    case CellLayer::kSmoothed:
      return Color{0.337, 0.706, 0.914};  // Sky blue.
    case CellLayer::kPrior:
      return Color{0.8, 0.6, 0.757};  // Reddish purple, made paler.
    case CellLayer::kUnknown:
    case CellLayer::kLand:
      break;
  }
  return std::nullopt;
}

const char* LayerName(CellLayer layer) {
  switch (layer) {
    case CellLayer::kLocal:
      return "measured, local map";
    case CellLayer::kGlobal:
      return "measured, global map";
    case CellLayer::kSmoothed:
      return "smoothed from neighbours";
    case CellLayer::kPrior:
      return "chart or default";
    case CellLayer::kUnknown:
      return "unknown";
    case CellLayer::kLand:
      return "land";
  }
  return "";
}

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
  // Long captions shrink rather than run into the next panel's.
  TextStyle style{.size = 13, .bold = true};
  while (style.size > 8 && canvas.TextWidth(caption, style) > bar.width) {
    style.size -= 0.5;
  }
  canvas.Text(caption, bar.x, bar.y - 7, style);
}

double KeyBoxWidth(Canvas& canvas, const std::string& text) {
  return 34 + canvas.TextWidth(text, {.size = 12.5}) + 22;
}

double DrawKeyBox(Canvas& canvas, double x, double y, const Color& color,
                  const std::string& text) {
  canvas.SetColor(color);
  canvas.Fill({x, y - 7, 26, 14});
  canvas.SetColor(kFrameColor);
  canvas.Stroke({x, y - 7, 26, 14}, 0.8);
  canvas.Text(text, x + 34, y + 4, {.size = 12.5, .color = kGrey});
  return x + KeyBoxWidth(canvas, text);
}

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
  const bool depth = std::find(input.panels.begin(), input.panels.end(),
                               PanelKind::kDepth) != input.panels.end();
  if (depth && !input.track.empty()) {
    canvas.SetColor(kTrackColor);
    canvas.Line(x, y, x + 26, y, 2.2);
    cairo_arc(cairo, x + 26, y, 4, 0, 2 * M_PI);
    cairo_fill(cairo);
    label("vehicle track");
  }
  if (depth && !input.contacts.empty()) {
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

}  // namespace fathom::client::cli
