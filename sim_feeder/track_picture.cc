#include "sim_feeder/track_picture.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "absl/strings/str_format.h"
#include "client/cli/canvas.h"
#include "client/cli/value_scale.h"
#include "sim_feeder/axes.h"

namespace fathom::feeder {
namespace {

using client::cli::Canvas;
using client::cli::Color;
using client::cli::Rectangle;
using client::cli::ValueScale;

// Colours that hold for who sees no red or green (Okabe and Ito).
constexpr Color kTruth = {0.0, 0.45, 0.7};
constexpr Color kEstimate = {0.84, 0.37, 0.0};
constexpr Color kEllipse = {0.0, 0.62, 0.45};

constexpr Rectangle kFrame = {.x = 80, .y = 70, .width = 700, .height = 700};
constexpr std::size_t kShipsWithManyEllipses = 20;
constexpr std::size_t kEllipseEvery = 10;

// Places to pixels.
struct Plan {
  double north_m;  // Of the frame's middle.
  double east_m;
  double side_m;

  double X(double east) const {
    return kFrame.x + kFrame.width * ((east - east_m) / side_m + 0.5);
  }
  double Y(double north) const {
    return kFrame.y + kFrame.height * (0.5 - (north - north_m) / side_m);
  }
};

Plan PlanOf(const ContactEvaluation& contacts) {
  double south = std::numeric_limits<double>::infinity();
  double north = -south;
  double west = south;
  double east = -south;
  for (const ContactTrack& track : contacts.tracks) {
    for (const TrackPoint& point : track.points) {
      south = std::min(south, point.truth.north_m);
      north = std::max(north, point.truth.north_m);
      west = std::min(west, point.truth.east_m);
      east = std::max(east, point.truth.east_m);
    }
  }
  return {
      .north_m = 0.5 * (south + north),
      .east_m = 0.5 * (west + east),
      .side_m = std::max({1.2 * (north - south), 1.2 * (east - west), 100.0})};
}

ValueScale ScaleAbout(double middle_m, double side_m) {
  return {middle_m - 0.5 * side_m, middle_m + 0.5 * side_m,
          ValueScale::Kind::kLinear};
}

// x' P^-1 x = 5.991: 95 % of two dimensions.
void DrawEllipse(Canvas& canvas, const Plan& plan, const TrackPoint& point) {
  const PositionCovariance& p = point.covariance;
  const double mean = 0.5 * (p.nn + p.ee);
  const double apart = std::hypot(0.5 * (p.nn - p.ee), p.ne);
  const double longer =
      std::sqrt(kChiSquare2At95 * std::max(0.0, mean + apart));
  const double shorter =
      std::sqrt(kChiSquare2At95 * std::max(0.0, mean - apart));
  // Of the longer axis, clockwise from north.
  const double azimuth = 0.5 * std::atan2(2.0 * p.ne, p.nn - p.ee);
  cairo_t* const pen = canvas.cairo();
  constexpr int kCorners = 48;
  for (int n = 0; n < kCorners; ++n) {
    const double angle = 2.0 * std::numbers::pi * n / kCorners;
    const double along = longer * std::cos(angle);
    const double across = shorter * std::sin(angle);
    cairo_line_to(pen,
                  plan.X(point.estimate.east_m + along * std::sin(azimuth) +
                         across * std::cos(azimuth)),
                  plan.Y(point.estimate.north_m + along * std::cos(azimuth) -
                         across * std::sin(azimuth)));
  }
  cairo_close_path(pen);
  canvas.SetColor(kEllipse, 0.8);
  cairo_set_line_width(pen, 1);
  cairo_stroke(pen);
}

void DrawTrack(Canvas& canvas, const Plan& plan, const ContactTrack& track,
               bool many_ellipses) {
  if (track.points.empty()) return;
  for (std::size_t i = 0; i < track.points.size(); ++i) {
    if (i + 1 == track.points.size() ||
        (many_ellipses && i % kEllipseEvery == 0)) {
      DrawEllipse(canvas, plan, track.points[i]);
    }
  }
  for (std::size_t i = 1; i < track.points.size(); ++i) {
    const PlanePoint& from = track.points[i - 1].truth;
    const PlanePoint& to = track.points[i].truth;
    canvas.SetColor(kTruth);
    canvas.Line(plan.X(from.east_m), plan.Y(from.north_m), plan.X(to.east_m),
                plan.Y(to.north_m), 2);
  }
  canvas.SetColor(kEstimate);
  for (const TrackPoint& point : track.points) {
    canvas.Fill({.x = plan.X(point.estimate.east_m) - 1.5,
                 .y = plan.Y(point.estimate.north_m) - 1.5,
                 .width = 3,
                 .height = 3});
  }
  if (!many_ellipses) return;
  const PlanePoint& end = track.points.back().truth;
  canvas.Text(track.contact_id, plan.X(end.east_m) + 6, plan.Y(end.north_m) - 6,
              {.size = 12, .halo = 3});
}

}  // namespace

absl::Status DrawTracks(const std::string& path, const std::string& title,
                        const ContactEvaluation& contacts) {
  Canvas canvas(800, 860);
  canvas.Text(title, kFrame.x, 28, {.size = 18, .bold = true});
  canvas.Text(
      absl::StrFormat("truth (blue), %d estimates (orange), 95 %% ellipses "
                      "(green); NEES %.2f (2 expected), %.1f %% inside",
                      contacts.during.count(), contacts.during.MeanNees(),
                      100.0 * contacts.during.ShareWithin95()),
      kFrame.x, 52, {.size = 13});
  const Plan plan = PlanOf(contacts);
  DrawAxes(canvas, kFrame,
           {.title = "",
            .across = "east of the area's south-west corner, m",
            .up = "up: north of it, m"},
           ScaleAbout(plan.east_m, plan.side_m),
           ScaleAbout(plan.north_m, plan.side_m));
  cairo_t* const pen = canvas.cairo();
  cairo_save(pen);
  cairo_rectangle(pen, kFrame.x, kFrame.y, kFrame.width, kFrame.height);
  cairo_clip(pen);
  for (const ContactTrack& track : contacts.tracks) {
    DrawTrack(canvas, plan, track,
              contacts.tracks.size() <= kShipsWithManyEllipses);
  }
  cairo_restore(pen);
  canvas.SetColor(kInk);
  canvas.Stroke(kFrame, 1);
  return canvas.WritePng(path);
}

}  // namespace fathom::feeder
