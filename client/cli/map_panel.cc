#include "client/cli/map_panel.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "absl/strings/str_format.h"
#include "client/cli/geo_math.h"

namespace fathom::client::cli {
namespace {

bool IsLand(const Region& region, std::size_t index) {
  return region.kind[index] == v1::EVIDENCE_KIND_LAND;
}

MetersPerDegree ScaleOf(const Region& region) {
  return MetersPerDegreeAt(region.north_west.latitude_deg() -
                           region.latitude_step_deg * region.rows / 2);
}

std::uint32_t Pixel(const Color& color) {
  const auto byte = [](double value) {
    return static_cast<std::uint32_t>(
        std::lround(255 * std::clamp(value, 0.0, 1.0)));
  };
  return 0xff000000u | byte(color.red) << 16 | byte(color.green) << 8 |
         byte(color.blue);
}

// The largest of these that fits `span_deg` about `most` times.
double GraticuleStep(double span_deg, int most) {
  constexpr std::array<double, 17> kSteps = {
      30,         20,         10,         5,         2,        1,
      30. / 60,   20. / 60,   10. / 60,   5. / 60,   2. / 60,  1. / 60,
      30. / 3600, 20. / 3600, 10. / 3600, 5. / 3600, 1. / 3600};
  double best = kSteps[0];
  for (const double step : kSteps) {
    if (span_deg / step <= most) best = step;
  }
  return best;
}

// "41°30'N"; seconds only where the step needs them.
std::string AngleText(double degrees, double step_deg, char positive,
                      char negative) {
  const auto seconds =
      static_cast<std::int64_t>(std::llround(std::abs(degrees) * 3600));
  const char side = degrees < 0 ? negative : positive;
  if (step_deg >= 1) {
    return absl::StrFormat("%d°%c", seconds / 3600, side);
  }
  if (step_deg >= 1.0 / 60) {
    return absl::StrFormat("%d°%02d′%c", seconds / 3600, seconds / 60 % 60,
                           side);
  }
  return absl::StrFormat("%d°%02d′%02d″%c", seconds / 3600, seconds / 60 % 60,
                         seconds % 60, side);
}

std::string LengthText(double meters) {
  return meters >= 1000 ? absl::StrFormat("%g km", meters / 1000)
                        : absl::StrFormat("%g m", meters);
}

}  // namespace

MapPanel::MapPanel(Canvas& canvas, const Region& region, const Rectangle& frame)
    : canvas_(canvas), region_(region), frame_(frame) {
  meters_per_pixel_ = region.longitude_step_deg * region.columns *
                      ScaleOf(region).longitude / frame.width;
}

double MapPanel::HeightPerWidth(const Region& region) {
  const MetersPerDegree scale = ScaleOf(region);
  return region.latitude_step_deg * region.rows * scale.latitude /
         (region.longitude_step_deg * region.columns * scale.longitude);
}

MapPanel::Point MapPanel::ToPixel(const v1::GeodeticPoint& place) const {
  const double width_deg = region_.longitude_step_deg * region_.columns;
  const double height_deg = region_.latitude_step_deg * region_.rows;
  // Counted from the middle, so that the antimeridian needs no thought.
  const double middle_deg = region_.north_west.longitude_deg() + width_deg / 2;
  const double east_deg = WrapLongitude(place.longitude_deg() - middle_deg);
  const double south_deg =
      region_.north_west.latitude_deg() - place.latitude_deg();
  return {frame_.x + frame_.width * (0.5 + east_deg / width_deg),
          frame_.y + frame_.height * south_deg / height_deg};
}

void MapPanel::ClipToFrame() {
  cairo_rectangle(canvas_.cairo(), frame_.x, frame_.y, frame_.width,
                  frame_.height);
  cairo_clip(canvas_.cairo());
}

void MapPanel::DrawCells(const CellColor& color_of) {
  canvas_.Hatch(frame_);
  const int columns = static_cast<int>(region_.columns);
  const int rows = static_cast<int>(region_.rows);
  cairo_surface_t* image =
      cairo_image_surface_create(CAIRO_FORMAT_ARGB32, columns, rows);
  cairo_surface_flush(image);
  auto* bytes = cairo_image_surface_get_data(image);
  const int stride = cairo_image_surface_get_stride(image);
  if (bytes == nullptr) {
    cairo_surface_destroy(image);
    return;
  }
  for (int row = 0; row < rows; ++row) {
    auto* line = reinterpret_cast<std::uint32_t*>(
        bytes + static_cast<std::ptrdiff_t>(row) * stride);
    for (int column = 0; column < columns; ++column) {
      const std::size_t index = region_.Index(
          static_cast<std::uint32_t>(row), static_cast<std::uint32_t>(column));
      Color color;
      if (IsLand(region_, index)) {
        line[column] = Pixel(kLandColor);
      } else if (color_of(index, &color)) {
        line[column] = Pixel(color);
      } else {
        line[column] = 0;  // Transparent: the hatching stays.
      }
    }
  }
  cairo_surface_mark_dirty(image);
  cairo_t* cairo = canvas_.cairo();
  cairo_save(cairo);
  ClipToFrame();
  cairo_translate(cairo, frame_.x, frame_.y);
  const double pixels_per_cell = frame_.width / columns;
  cairo_scale(cairo, pixels_per_cell, frame_.height / rows);
  cairo_set_source_surface(cairo, image, 0, 0);
  // Cells larger than a pixel show as they are; smaller ones are averaged.
  cairo_pattern_set_filter(cairo_get_source(cairo), pixels_per_cell >= 1
                                                        ? CAIRO_FILTER_NEAREST
                                                        : CAIRO_FILTER_GOOD);
  cairo_paint(cairo);
  cairo_restore(cairo);
  cairo_surface_destroy(image);
  DrawShore();
}

void MapPanel::DrawShore() {
  if (region_.kind.size() > kMaxOutlinedCells) return;
  cairo_t* cairo = canvas_.cairo();
  const double cell_x = frame_.width / region_.columns;
  const double cell_y = frame_.height / region_.rows;
  for (std::uint32_t row = 0; row < region_.rows; ++row) {
    for (std::uint32_t column = 0; column < region_.columns; ++column) {
      const std::size_t index = region_.Index(row, column);
      const double x = frame_.x + column * cell_x;
      const double y = frame_.y + row * cell_y;
      if (column > 0 && IsLand(region_, index) != IsLand(region_, index - 1)) {
        cairo_move_to(cairo, x, y);
        cairo_line_to(cairo, x, y + cell_y);
      }
      if (row > 0 &&
          IsLand(region_, index) != IsLand(region_, index - region_.columns)) {
        cairo_move_to(cairo, x, y);
        cairo_line_to(cairo, x + cell_x, y);
      }
    }
  }
  canvas_.SetColor(kShoreColor, 0.9);
  cairo_set_line_width(cairo, 0.9);
  cairo_stroke(cairo);
}

void MapPanel::DrawGraticule() {
  cairo_t* cairo = canvas_.cairo();
  const double width_deg = region_.longitude_step_deg * region_.columns;
  const double height_deg = region_.latitude_step_deg * region_.rows;
  const double north = region_.north_west.latitude_deg();
  const double west = region_.north_west.longitude_deg();
  const TextStyle small{.size = 12, .color = {0.3, 0.33, 0.37}};

  const double column_step = GraticuleStep(width_deg, 6);
  for (const double mark : Multiples(column_step, west, west + width_deg)) {
    const double x = frame_.x + frame_.width * (mark - west) / width_deg;
    canvas_.SetColor(kFrameColor, 0.13);
    canvas_.Line(x, frame_.y, x, frame_.y + frame_.height, 0.8);
    canvas_.SetColor(kFrameColor);
    canvas_.Line(x, frame_.y + frame_.height, x, frame_.y + frame_.height + 5,
                 1);
    // Within the frame's width, clear of the next panel's.
    const std::string text =
        AngleText(WrapLongitude(mark), column_step, 'E', 'W');
    const double width = canvas_.TextWidth(text, small);
    canvas_.Text(
        text,
        std::clamp(x - width / 2, frame_.x,
                   std::max(frame_.x, frame_.x + frame_.width - width)),
        frame_.y + frame_.height + 20, small);
  }
  const double row_step = GraticuleStep(height_deg, 6);
  for (const double mark : Multiples(row_step, north - height_deg, north)) {
    const double y = frame_.y + frame_.height * (north - mark) / height_deg;
    canvas_.SetColor(kFrameColor, 0.13);
    canvas_.Line(frame_.x, y, frame_.x + frame_.width, y, 0.8);
    canvas_.SetColor(kFrameColor);
    canvas_.Line(frame_.x - 5, y, frame_.x, y, 1);
    // Along the side, so that the margin stays narrow.
    // The corners belong to the longitudes.
    if (y > frame_.y + frame_.height - 24 || y < frame_.y + 24) continue;
    const std::string text = AngleText(mark, row_step, 'N', 'S');
    cairo_save(cairo);
    cairo_translate(cairo, frame_.x - 9, y);
    cairo_rotate(cairo, -std::numbers::pi / 2);
    TextStyle style = small;
    style.align = Align::kCenter;
    canvas_.Text(text, 0, 0, style);
    cairo_restore(cairo);
  }
  canvas_.SetColor(kFrameColor);
  canvas_.Stroke(frame_, 1.4);
}

void MapPanel::DrawScaleBar() {
  const double length_m = RoundStep(0.28 * frame_.width * meters_per_pixel_);
  const double length_px = length_m / meters_per_pixel_;
  const Rectangle box{frame_.x + 14, frame_.y + frame_.height - 52,
                      length_px + 64, 38};
  canvas_.SetColor(kWhiteColor, 0.88);
  canvas_.Fill(box);
  const double x = box.x + 26;
  const double y = box.y + 12;
  constexpr int kParts = 4;
  for (int part = 0; part < kParts; ++part) {
    canvas_.SetColor(part % 2 == 0 ? kFrameColor : kWhiteColor);
    canvas_.Fill({x + part * length_px / kParts, y, length_px / kParts, 5});
  }
  canvas_.SetColor(kFrameColor);
  canvas_.Stroke({x, y, length_px, 5}, 1);
  const TextStyle style{.size = 11.5, .align = Align::kCenter};
  canvas_.Text("0", x, y + 19, style);
  canvas_.Text(LengthText(length_m), x + length_px, y + 19,
               {.size = 11.5, .align = Align::kCenter});
}

void MapPanel::DrawNorthArrow() {
  cairo_t* cairo = canvas_.cairo();
  const double x = frame_.x + frame_.width - 32;
  const double y = frame_.y + 22;
  canvas_.SetColor(kWhiteColor, 0.82);
  cairo_arc(cairo, x, y + 16, 25, 0, 2 * std::numbers::pi);
  cairo_fill(cairo);
  for (const double side : {-1.0, 1.0}) {
    cairo_move_to(cairo, x, y + 6);
    cairo_line_to(cairo, x + side * 8, y + 34);
    cairo_line_to(cairo, x, y + 28);
    cairo_close_path(cairo);
    canvas_.SetColor(side < 0 ? kFrameColor : kWhiteColor);
    cairo_fill_preserve(cairo);
    canvas_.SetColor(kFrameColor);
    cairo_set_line_width(cairo, 1);
    cairo_stroke(cairo);
  }
  canvas_.Text("N", x, y + 4,
               {.size = 13, .bold = true, .align = Align::kCenter});
}

}  // namespace fathom::client::cli
