// Depth contours with their depths written on them (map_panel.h).

#include <algorithm>
#include <cmath>
#include <numbers>

#include "client/cli/contour_lines.h"
#include "client/cli/map_panel.h"

namespace fathom::client::cli {
namespace {

// Lines shorter than this are specks, and are not drawn, pixels.
constexpr double kShortestLine = 14;
// A label wants this much of line about it, pixels, and this much distance to
// the next label of the same line.
constexpr double kLabelEvery = 420;
constexpr double kLabelSize = 11;
// Between any two labels.
constexpr double kLabelGap = 16;
constexpr Color kContourColor = {0.05, 0.1, 0.25};

}  // namespace

void MapPanel::DrawContours(const std::vector<float>& values,
                            const std::vector<double>& levels) {
  if (values.size() > kMaxOutlinedCells) return;
  cairo_t* cairo = canvas_.cairo();
  const double cell_x = frame_.width / region_.columns;
  const double cell_y = frame_.height / region_.rows;
  cairo_save(cairo);
  ClipToFrame();
  cairo_set_line_join(cairo, CAIRO_LINE_JOIN_ROUND);
  for (const double level : levels) {
    for (const ContourLine& line :
         TraceContour(values, region_.rows, region_.columns, level)) {
      std::vector<Point> points;
      std::vector<double> along = {0};
      for (const GridPoint& p : line.points) {
        points.push_back({frame_.x + p.x * cell_x, frame_.y + p.y * cell_y});
        if (points.size() > 1) {
          const Point& before = points[points.size() - 2];
          along.push_back(along.back() +
                          std::hypot(points.back().x - before.x,
                                     points.back().y - before.y));
        }
      }
      if (along.back() < kShortestLine) continue;
      cairo_move_to(cairo, points[0].x, points[0].y);
      for (const Point& p : points) cairo_line_to(cairo, p.x, p.y);
      canvas_.SetColor(kContourColor, 0.42);
      cairo_set_line_width(cairo, 0.8);
      cairo_stroke(cairo);
      AddContourLabels(ValueScale::TickText(level), points, along);
    }
  }
  cairo_restore(cairo);
}

void MapPanel::AddContourLabels(const std::string& text,
                                const std::vector<Point>& points,
                                const std::vector<double>& along) {
  const TextStyle style{.size = kLabelSize, .color = kContourColor};
  const double width = canvas_.TextWidth(text, style) + 6;
  const double length = along.back();
  double from = 0.5 * width;
  while (from + width < length) {
    // The straightest stretch of this part of the line that is free.
    const double until = std::min(length - width, from + kLabelEvery);
    double best = 0.92;  // Chord per length: what bends more has no label.
    ContourLabel label;
    const int tries = static_cast<int>((until - from) / (width / 2));
    for (int n = 0; n <= tries; ++n) {
      const double at = from + n * width / 2;
      const auto index = [&](double s) {
        return static_cast<std::size_t>(
            std::lower_bound(along.begin(), along.end(), s) - along.begin());
      };
      const std::size_t i = index(at);
      const std::size_t j = std::min(index(at + width), points.size() - 1);
      if (j <= i) continue;
      const Point& a = points[i];
      const Point& b = points[j];
      const double straight =
          std::hypot(b.x - a.x, b.y - a.y) / std::max(1.0, along[j] - along[i]);
      const Point middle{(a.x + b.x) / 2, (a.y + b.y) / 2};
      if (straight <= best || !IsFree(middle, width)) continue;
      best = straight;
      double angle = std::atan2(b.y - a.y, b.x - a.x);
      // Never upside down.
      if (angle > std::numbers::pi / 2) angle -= std::numbers::pi;
      if (angle < -std::numbers::pi / 2) angle += std::numbers::pi;
      label = {text, middle, angle, width / 2};
    }
    if (!label.text.empty()) contour_labels_.push_back(label);
    from = until + kLabelEvery / 2;
  }
}

bool MapPanel::IsFree(const Point& middle, double width) const {
  const double half = width / 2 + 4;
  if (middle.x - half < frame_.x || middle.x + half > frame_.x + frame_.width ||
      middle.y - half < frame_.y ||
      middle.y + half > frame_.y + frame_.height) {
    return false;
  }
  // The scale bar and the north arrow keep their corners.
  if (middle.y > frame_.y + frame_.height - 64 &&
      middle.x < frame_.x + 0.28 * frame_.width + 100) {
    return false;
  }
  if (middle.y < frame_.y + 74 && middle.x > frame_.x + frame_.width - 74) {
    return false;
  }
  return std::none_of(contour_labels_.begin(), contour_labels_.end(),
                      [&](const ContourLabel& other) {
                        return std::hypot(other.at.x - middle.x,
                                          other.at.y - middle.y) <
                               half + other.half_width + kLabelGap;
                      });
}

void MapPanel::DrawContourLabels() {
  cairo_t* cairo = canvas_.cairo();
  for (const ContourLabel& label : contour_labels_) {
    cairo_save(cairo);
    cairo_translate(cairo, label.at.x, label.at.y);
    cairo_rotate(cairo, label.angle);
    canvas_.Text(label.text, 0, kLabelSize * 0.36,
                 {.size = kLabelSize,
                  .color = kContourColor,
                  .align = Align::kCenter,
                  .halo = 1.8});
    cairo_restore(cairo);
  }
}

}  // namespace fathom::client::cli
