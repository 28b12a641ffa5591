#include "tests/accuracy/thesis_picture.h"

#include <algorithm>
#include <limits>
#include <optional>

#include "absl/strings/str_format.h"
#include "client/cli/canvas.h"
#include "client/cli/colormap.h"
#include "tests/accuracy/thesis_scene.h"

namespace fathom::accuracy {

bool DrawThesisScene(const Terrain& terrain, const std::string& path) {
  using client::cli::Canvas;
  using client::cli::Colormap;
  const std::optional<ThesisWindow> window = FirstThesisWindow(terrain);
  if (!window.has_value()) return false;
  const map::GlobalMapView& view = window->view;
  const auto box = view.root().BoxAround(window->corners);
  if (!box.has_value()) return false;
  float least_m = std::numeric_limits<float>::infinity();
  float most_m = -least_m;
  view.ForEachLeafIn(*box, [&](const map::CellKey&, const map::Leaf& leaf) {
    if (!leaf.known()) return;
    least_m = std::min(least_m, leaf.depth_m);
    most_m = std::max(most_m, leaf.depth_m);
  });
  constexpr double kLeft = 20;
  constexpr double kTop = 60;
  constexpr double kPanel = 500;
  Canvas canvas(540, 580);
  canvas.Text(
      absl::StrFormat(
          "500 m x 500 m of Woods Hole: %d leaves, %.1f kB; %d before",
          view.leaf_count(), static_cast<double>(view.memory_bytes()) / 1000,
          window->fine_leaves),
      kLeft, 26, {.size = 14, .bold = true});
  canvas.Text(
      absl::StrFormat("depth %.1f m (pale) to %.1f m (dark)", least_m, most_m),
      kLeft, 46, {.size = 12});
  const Colormap colors = Colormap::Depth();
  const map::NedPoint low = window->frame.ToNed(window->corners[0]);
  const map::NedPoint high = window->frame.ToNed(window->corners[2]);
  view.ForEachLeafIn(*box, [&](const map::CellKey& cell,
                               const map::Leaf& leaf) {
    if (!leaf.known()) return;
    cairo_t* const pen = canvas.cairo();
    for (const map::GeodeticPoint& point : view.root().Corners(cell)) {
      const map::NedPoint at = window->frame.ToNed(point);
      const double east = (at.east_m - low.east_m) / (high.east_m - low.east_m);
      const double north =
          (at.north_m - low.north_m) / (high.north_m - low.north_m);
      cairo_line_to(pen, kLeft + kPanel * east, kTop + kPanel * (1 - north));
    }
    cairo_close_path(pen);
    canvas.SetColor(colors.At((leaf.depth_m - least_m) /
                              std::max(1e-3f, most_m - least_m)));
    cairo_fill_preserve(pen);
    canvas.SetColor({0.35, 0.38, 0.42});
    cairo_set_line_width(pen, 0.6);
    cairo_stroke(pen);
  });
  return canvas.WritePng(path).ok();
}

}  // namespace fathom::accuracy
