// What moves on a map: the vehicle's track and the contacts (map_panel.h).

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "absl/strings/str_format.h"
#include "client/cli/map_panel.h"

namespace fathom::client::cli {
namespace {

// Seconds of motion that a contact's line shows.
constexpr double kMotionLineS = 60;

}  // namespace

void MapPanel::DrawTrack(const std::vector<v1::GeodeticPoint>& track) {
  if (track.empty()) return;
  cairo_t* cairo = canvas_.cairo();
  cairo_save(cairo);
  ClipToFrame();
  cairo_set_line_join(cairo, CAIRO_LINE_JOIN_ROUND);
  for (const bool halo : {true, false}) {
    for (std::size_t i = 0; i < track.size(); ++i) {
      const Point p = ToPixel(track[i]);
      if (i == 0) {
        cairo_move_to(cairo, p.x, p.y);
      } else {
        cairo_line_to(cairo, p.x, p.y);
      }
    }
    canvas_.SetColor(halo ? kWhiteColor : kTrackColor, halo ? 0.55 : 1);
    cairo_set_line_width(cairo, halo ? 2.8 : 1.4);
    cairo_stroke(cairo);
  }
  const Point start = ToPixel(track.front());
  const Point end = ToPixel(track.back());
  for (const auto& [p, filled] :
       {std::pair{start, false}, std::pair{end, true}}) {
    cairo_arc(cairo, p.x, p.y, 5, 0, 2 * std::numbers::pi);
    canvas_.SetColor(filled ? kTrackColor : kWhiteColor);
    cairo_fill_preserve(cairo);
    canvas_.SetColor(filled ? kWhiteColor : kTrackColor);
    cairo_set_line_width(cairo, 2);
    cairo_stroke(cairo);
  }
  cairo_restore(cairo);
}

void MapPanel::PlaceLabel(const std::string& text, Point at, bool ends_at,
                          double size) {
  TextStyle style{
      .size = size, .color = kContactColor, .bold = true, .halo = 2};
  const double width = canvas_.TextWidth(text, style);
  if (ends_at) at.x -= width;
  at.x =
      std::clamp(at.x, frame_.x + 6,
                 std::max(frame_.x + 6, frame_.x + frame_.width - 6 - width));
  at.y = std::clamp(at.y, frame_.y + 16, frame_.y + frame_.height - 8);
  // Down, line by line, until it covers no other label.
  constexpr int kMostLines = 12;
  for (int line = 0; line < kMostLines; ++line) {
    const bool covers = std::any_of(
        labels_.begin(), labels_.end(), [&](const Rectangle& other) {
          return at.x < other.x + other.width && other.x < at.x + width &&
                 std::abs(at.y - other.y) < size + 3;
        });
    if (!covers) break;
    at.y += size + 4;
  }
  labels_.push_back({at.x, at.y, width, size});
  canvas_.Text(text, at.x, at.y, style);
}

void MapPanel::DrawContacts(const std::vector<v1::ContactEstimate>& contacts) {
  cairo_t* cairo = canvas_.cairo();
  cairo_save(cairo);
  ClipToFrame();
  for (const v1::ContactEstimate& contact : contacts) {
    const Point p = ToPixel(contact.position());
    if (p.x < frame_.x || p.x > frame_.x + frame_.width || p.y < frame_.y ||
        p.y > frame_.y + frame_.height) {
      DrawContactOutside(contact, p);
      continue;
    }
    if (contact.covariance_size() == 10) {
      // Half axes are the roots of the eigenvalues of [nn ne; ne ee].
      const double nn = contact.covariance(0);
      const double ne = contact.covariance(1);
      const double ee = contact.covariance(4);
      const double middle = (nn + ee) / 2;
      const double spread = std::hypot((nn - ee) / 2, ne);
      const double major_m = std::sqrt(std::max(0.0, middle + spread));
      const double minor_m = std::sqrt(std::max(0.0, middle - spread));
      // Angle of the major axis from north towards east.
      const double angle = 0.5 * std::atan2(2 * ne, nn - ee);
      for (const double sigmas : {2.0, 1.0}) {
        cairo_save(cairo);
        cairo_translate(cairo, p.x, p.y);
        cairo_rotate(cairo, angle);
        // Major axis up the page (north); never thinner than a pixel.
        cairo_scale(cairo, std::max(0.5, sigmas * minor_m / meters_per_pixel_),
                    std::max(0.5, sigmas * major_m / meters_per_pixel_));
        cairo_arc(cairo, 0, 0, 1, 0, 2 * std::numbers::pi);
        cairo_restore(cairo);
        canvas_.SetColor(kContactColor, 0.14);
        cairo_fill_preserve(cairo);
        canvas_.SetColor(kContactColor, sigmas == 1 ? 1 : 0.7);
        cairo_set_line_width(cairo, sigmas == 1 ? 1.4 : 1);
        cairo_stroke(cairo);
      }
    }
    const double east_px =
        contact.velocity_east_m_s() * kMotionLineS / meters_per_pixel_;
    const double north_px =
        contact.velocity_north_m_s() * kMotionLineS / meters_per_pixel_;
    canvas_.SetColor(kContactColor);
    canvas_.Line(p.x, p.y, p.x + east_px, p.y - north_px, 1.8);
    cairo_arc(cairo, p.x, p.y, 3.6, 0, 2 * std::numbers::pi);
    cairo_fill_preserve(cairo);
    canvas_.SetColor(kWhiteColor);
    cairo_set_line_width(cairo, 1);
    cairo_stroke(cairo);
    // Beside the line of motion, not on it.
    const bool left = east_px > 0 && north_px > 0;
    PlaceLabel(contact.contact_id(), {p.x + (left ? -8 : 8), p.y - 7}, left,
               13);
  }
  cairo_restore(cairo);
}

void MapPanel::DrawContactOutside(const v1::ContactEstimate& contact,
                                  const Point& p) {
  cairo_t* cairo = canvas_.cairo();
  const Point middle{frame_.x + frame_.width / 2, frame_.y + frame_.height / 2};
  const double dx = p.x - middle.x;
  const double dy = p.y - middle.y;
  // Where the line from the middle meets the frame, a little inside.
  constexpr double kInset = 9;
  const double reach =
      std::min((frame_.width / 2 - kInset) / std::max(1e-9, std::abs(dx)),
               (frame_.height / 2 - kInset) / std::max(1e-9, std::abs(dy)));
  const Point at{middle.x + reach * dx, middle.y + reach * dy};
  cairo_save(cairo);
  cairo_translate(cairo, at.x, at.y);
  cairo_rotate(cairo, std::atan2(dy, dx));
  cairo_move_to(cairo, 8, 0);
  cairo_line_to(cairo, -8, -5);
  cairo_line_to(cairo, -8, 5);
  cairo_close_path(cairo);
  cairo_restore(cairo);
  canvas_.SetColor(kContactColor);
  cairo_fill_preserve(cairo);
  canvas_.SetColor(kWhiteColor);
  cairo_set_line_width(cairo, 1);
  cairo_stroke(cairo);
  const double away_m =
      (std::hypot(dx, dy) - std::hypot(at.x - middle.x, at.y - middle.y)) *
      meters_per_pixel_;
  const std::string text =
      absl::StrFormat("%s, %s", contact.contact_id(),
                      away_m >= 1000 ? absl::StrFormat("%.1f km", away_m / 1000)
                                     : absl::StrFormat("%.0f m", away_m));
  // Towards the middle of the frame, clear of the arrow.
  PlaceLabel(text, {at.x + (dx > 0 ? -13 : 13), at.y + 4}, dx > 0, 12);
}

}  // namespace fathom::client::cli
