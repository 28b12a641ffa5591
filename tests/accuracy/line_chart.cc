#include "tests/accuracy/line_chart.h"

#include <cairo.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>

namespace fathom::accuracy {
namespace {

constexpr int kWidth = 560;
constexpr int kHeight = 340;
constexpr double kLeft = 64;
constexpr double kRight = 12;
constexpr double kTop = 44;
constexpr double kBottom = 42;

// 1, 2 or 5 times a power of ten: some five of them in the span.
double TickOf(double span) {
  const double power = std::pow(10, std::floor(std::log10(span / 5)));
  for (const double step : {1.0, 2.0, 5.0}) {
    if (span / (step * power) <= 7) return step * power;
  }
  return 10 * power;
}

struct Axis {
  double low;
  double high;
  double from;  // Pixels.
  double to;

  double At(double value) const {
    return from + (to - from) * (value - low) / (high - low);
  }
};

class Pen {
 public:
  Pen()
      : surface_(
            cairo_image_surface_create(CAIRO_FORMAT_RGB24, kWidth, kHeight),
            cairo_surface_destroy),
        cairo_(cairo_create(surface_.get()), cairo_destroy) {
    Color(1, 1, 1);
    cairo_paint(cairo_.get());
    cairo_select_font_face(cairo_.get(), "sans-serif", CAIRO_FONT_SLANT_NORMAL,
                           CAIRO_FONT_WEIGHT_NORMAL);
    cairo_set_font_size(cairo_.get(), 11);
  }
  cairo_t* get() const { return cairo_.get(); }
  void Color(double red, double green, double blue) {
    cairo_set_source_rgb(cairo_.get(), red, green, blue);
  }
  double WidthOf(const std::string& text) {
    cairo_text_extents_t extents;
    cairo_text_extents(cairo_.get(), text.c_str(), &extents);
    return extents.x_advance;
  }
  // `share` of its width lies left of x.
  void Text(const std::string& text, double x, double y, double share) {
    cairo_move_to(cairo_.get(), x - share * WidthOf(text), y);
    cairo_show_text(cairo_.get(), text.c_str());
  }
  void Line(double x0, double y0, double x1, double y1) {
    cairo_move_to(cairo_.get(), x0, y0);
    cairo_line_to(cairo_.get(), x1, y1);
    cairo_stroke(cairo_.get());
  }
  bool Write(const std::string& path) {
    return cairo_surface_write_to_png(surface_.get(), path.c_str()) ==
           CAIRO_STATUS_SUCCESS;
  }

 private:
  std::unique_ptr<cairo_surface_t, void (*)(cairo_surface_t*)> surface_;
  std::unique_ptr<cairo_t, void (*)(cairo_t*)> cairo_;
};

void DrawGrid(const Axis& axis, bool vertical, Pen& pen) {
  const double tick = TickOf(axis.high - axis.low);
  cairo_set_line_width(pen.get(), 1);
  for (double value = std::ceil(axis.low / tick) * tick; value <= axis.high;
       value += tick) {
    const double at = std::floor(axis.At(value)) + 0.5;
    char text[32];
    std::snprintf(text, sizeof text, "%g",
                  std::fabs(value) < 1e-9 * tick ? 0.0 : value);
    pen.Color(0.88, 0.88, 0.88);
    if (vertical) {
      pen.Line(kLeft, at, kWidth - kRight, at);
      pen.Color(0.2, 0.2, 0.2);
      pen.Text(text, kLeft - 6, at + 4, 1);
    } else {
      pen.Line(at, kTop, at, kHeight - kBottom);
      pen.Color(0.2, 0.2, 0.2);
      pen.Text(text, at, kHeight - kBottom + 15, 0.5);
    }
  }
}

void DrawSeries(const LineChart& chart, const ChartSeries& series,
                const Axis& x_axis, const Axis& y_axis, Pen& pen) {
  pen.Color(series.red, series.green, series.blue);
  cairo_set_line_width(pen.get(), 1.5);
  for (std::size_t i = 0; i < series.values.size(); ++i) {
    const double x = x_axis.At(chart.x[i]);
    const double y = y_axis.At(series.values[i]);
    if (series.points) {
      cairo_arc(pen.get(), x, y, 1.6, 0, 2 * M_PI);
      cairo_fill(pen.get());
    } else if (i == 0) {
      cairo_move_to(pen.get(), x, y);
    } else {
      cairo_line_to(pen.get(), x, y);
    }
  }
  if (!series.points) cairo_stroke(pen.get());
}

}  // namespace

bool DrawChart(const LineChart& chart, const std::string& path) {
  double low = INFINITY;
  double high = -INFINITY;
  for (const ChartSeries& series : chart.series) {
    for (const double value : series.values) {
      low = std::min(low, value);
      high = std::max(high, value);
    }
  }
  const double margin = high > low ? 0.05 * (high - low) : 1.0;
  const Axis x_axis{.low = chart.x.front(),
                    .high = chart.x.back(),
                    .from = kLeft,
                    .to = kWidth - kRight};
  const Axis y_axis{.low = low - margin,
                    .high = high + margin,
                    .from = kHeight - kBottom,
                    .to = kTop};
  Pen pen;
  DrawGrid(x_axis, false, pen);
  DrawGrid(y_axis, true, pen);
  for (const ChartSeries& series : chart.series) {
    DrawSeries(chart, series, x_axis, y_axis, pen);
  }
  pen.Color(0.1, 0.1, 0.1);
  pen.Text(chart.title, kLeft, 16, 0);
  pen.Text(chart.x_label, 0.5 * (kLeft + kWidth - kRight), kHeight - 8, 0.5);
  pen.Text(chart.y_label, 6, 32, 0);
  double x = kWidth - kRight;
  for (auto series = chart.series.rbegin(); series != chart.series.rend();
       ++series) {
    if (series->name.empty()) continue;
    pen.Color(series->red, series->green, series->blue);
    pen.Text(series->name, x, 32, 1);
    x -= pen.WidthOf(series->name) + 14;
  }
  return pen.Write(path);
}

}  // namespace fathom::accuracy
