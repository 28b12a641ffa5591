#include "client/cli/canvas.h"

#include "absl/strings/str_format.h"
#include "client/cli/exit_code.h"

namespace fathom::client::cli {

Canvas::Canvas(int width, int height)
    : surface_(cairo_image_surface_create(CAIRO_FORMAT_ARGB32, width, height)),
      cairo_(cairo_create(surface_.get())) {
  cairo_set_source_rgb(cairo(), 1, 1, 1);
  cairo_paint(cairo());
}

void Canvas::SetColor(const Color& color, double alpha) {
  cairo_set_source_rgba(cairo(), color.red, color.green, color.blue, alpha);
}

void Canvas::Fill(const Rectangle& r) {
  cairo_rectangle(cairo(), r.x, r.y, r.width, r.height);
  cairo_fill(cairo());
}

void Canvas::Stroke(const Rectangle& r, double line_width) {
  cairo_set_line_width(cairo(), line_width);
  cairo_rectangle(cairo(), r.x, r.y, r.width, r.height);
  cairo_stroke(cairo());
}

void Canvas::Line(double x0, double y0, double x1, double y1,
                  double line_width) {
  cairo_set_line_width(cairo(), line_width);
  cairo_move_to(cairo(), x0, y0);
  cairo_line_to(cairo(), x1, y1);
  cairo_stroke(cairo());
}

void Canvas::SelectFont(const TextStyle& style) {
  cairo_select_font_face(
      cairo(), "DejaVu Sans", CAIRO_FONT_SLANT_NORMAL,
      style.bold ? CAIRO_FONT_WEIGHT_BOLD : CAIRO_FONT_WEIGHT_NORMAL);
  cairo_set_font_size(cairo(), style.size);
}

double Canvas::TextWidth(const std::string& text, const TextStyle& style) {
  SelectFont(style);
  cairo_text_extents_t extents;
  cairo_text_extents(cairo(), text.c_str(), &extents);
  return extents.x_advance;
}

void Canvas::Text(const std::string& text, double x, double y,
                  const TextStyle& style) {
  const double width = TextWidth(text, style);
  if (style.align == Align::kCenter) x -= width / 2;
  if (style.align == Align::kRight) x -= width;
  cairo_new_path(cairo());
  if (style.halo > 0) {
    cairo_move_to(cairo(), x, y);
    cairo_text_path(cairo(), text.c_str());
    cairo_set_line_join(cairo(), CAIRO_LINE_JOIN_ROUND);
    cairo_set_line_width(cairo(), 2 * style.halo);
    cairo_set_source_rgba(cairo(), 1, 1, 1, 0.85);
    cairo_stroke(cairo());
  }
  SetColor(style.color);
  cairo_move_to(cairo(), x, y);
  cairo_show_text(cairo(), text.c_str());
  cairo_new_path(cairo());
}

void Canvas::Hatch(const Rectangle& r) {
  constexpr double kSpacing = 8;
  cairo_save(cairo());
  cairo_rectangle(cairo(), r.x, r.y, r.width, r.height);
  cairo_clip(cairo());
  cairo_set_source_rgb(cairo(), 0.925, 0.93, 0.935);
  cairo_paint(cairo());
  cairo_set_source_rgb(cairo(), 0.78, 0.79, 0.80);
  cairo_set_line_width(cairo(), 1);
  for (int i = 0; i * kSpacing < r.width + r.height; ++i) {
    const double offset = i * kSpacing - r.height;
    cairo_move_to(cairo(), r.x + offset, r.y + r.height);
    cairo_line_to(cairo(), r.x + offset + r.height, r.y);
  }
  cairo_stroke(cairo());
  cairo_restore(cairo());
}

absl::Status Canvas::WritePng(const std::string& path) {
  cairo_surface_flush(surface_.get());
  const cairo_status_t status =
      cairo_surface_write_to_png(surface_.get(), path.c_str());
  if (status == CAIRO_STATUS_SUCCESS) return absl::OkStatus();
  return FileError(absl::InvalidArgumentError(absl::StrFormat(
      "%s: cannot be written: %s", path, cairo_status_to_string(status))));
}

}  // namespace fathom::client::cli
