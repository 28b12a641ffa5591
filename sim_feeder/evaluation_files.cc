#include "sim_feeder/evaluation_files.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <string_view>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "client/cli/canvas.h"
#include "client/cli/colormap.h"
#include "client/cli/value_scale.h"
#include "sim_feeder/axes.h"
#include "sim_feeder/evaluation_report.h"
#include "sim_feeder/track_picture.h"

namespace fathom::feeder {
namespace {

using client::cli::Align;
using client::cli::Canvas;
using client::cli::Color;
using client::cli::Colormap;
using client::cli::Rectangle;
using client::cli::ValueScale;

constexpr Color kBar = {0.42, 0.58, 0.75};
constexpr Color kLine = {0.93, 0.36, 0.13};

constexpr double kPanel = 420;
constexpr double kTop = 110;
constexpr double kLeft = 70;
constexpr double kGap = 110;
constexpr int kWidth = 1600;
constexpr int kHeight = 640;

Rectangle PanelFrame(int index) {
  return {.x = kLeft + index * (kPanel + kGap),
          .y = kTop,
          .width = kPanel,
          .height = kPanel};
}

bool IsKnown(const PlaceAnswer& place) { return place.std_m > 0; }

void DrawErrors(Canvas& canvas, const SurveyArea& area,
                const DepthEvaluation& depth) {
  // The true shape of the area within the panel.
  const double side_m = std::max(area.north_extent_m, area.east_extent_m);
  Rectangle frame = PanelFrame(0);
  frame.width = kPanel * area.east_extent_m / side_m;
  frame.height = kPanel * area.north_extent_m / side_m;
  double square_sum_m2 = 0;
  std::size_t known = 0;
  for (const PlaceAnswer& place : depth.places) {
    if (!IsKnown(place)) continue;
    square_sum_m2 += std::pow(place.mean_m - place.truth_m, 2);
    ++known;
  }
  const double rmse_m =
      known == 0 ? 1 : std::sqrt(square_sum_m2 / static_cast<double>(known));
  const double end_m = std::max(1e-3, 2 * rmse_m);
  DrawAxes(canvas, frame,
           {.title = "Depth: the map's minus the truth, m",
            .across = "east, m",
            .up = "up: north, m"},
           {0, area.east_extent_m, ValueScale::Kind::kLinear},
           {0, area.north_extent_m, ValueScale::Kind::kLinear});
  canvas.Hatch(frame);
  const Colormap colors = Colormap::Difference();
  // So that the places cover the area about once.
  const double dot = std::clamp(
      std::sqrt(frame.width * frame.height /
                std::max(1.0, static_cast<double>(depth.places.size()))),
      1.5, 12.0);
  for (const PlaceAnswer& place : depth.places) {
    if (!IsKnown(place)) continue;
    const double error_m = place.mean_m - place.truth_m;
    canvas.SetColor(colors.At(0.5 + 0.5 * error_m / end_m));
    canvas.Fill({.x = frame.x +
                      frame.width * place.east_m / area.east_extent_m - dot / 2,
                 .y = frame.y +
                      frame.height * (1 - place.north_m / area.north_extent_m) -
                      dot / 2,
                 .width = dot,
                 .height = dot});
  }
  canvas.SetColor(kInk);
  canvas.Stroke(frame, 1);
  // The key: shoaler than the truth on the left.
  constexpr int kSteps = 60;
  const double y = kTop - 70;
  for (int n = 0; n < kSteps; ++n) {
    canvas.SetColor(colors.At((n + 0.5) / kSteps));
    canvas.Fill(
        {.x = frame.x + 250 + 2.0 * n, .y = y, .width = 2, .height = 12});
  }
  canvas.Text(absl::StrFormat("%.2g", -end_m), frame.x + 244, y + 11,
              {.size = 12, .align = Align::kRight});
  canvas.Text(absl::StrFormat("+%.2g m", end_m), frame.x + 376, y + 11,
              {.size = 12});
}

void DrawReliability(Canvas& canvas, const DepthEvaluation& depth) {
  const Rectangle frame = PanelFrame(1);
  const ValueScale unit(0, 1, ValueScale::Kind::kLinear);
  DrawAxes(canvas, frame,
           {.title = "Obstacle answers: what was stated came true",
            .across = "probability stated",
            .up = "up: share that came true; bars: answers"},
           unit, unit);
  const ReliabilityScore& score = depth.reliability;
  const double most = static_cast<double>(
      std::max_element(
          score.bins().begin(), score.bins().end(),
          [](const auto& a, const auto& b) { return a.count < b.count; })
          ->count);
  for (std::size_t n = 0; most > 0 && n < ReliabilityScore::kBins; ++n) {
    const ReliabilityScore::Bin& bin = score.bins()[n];
    const double height =
        0.25 * frame.height * static_cast<double>(bin.count) / most;
    canvas.SetColor(kBar, 0.5);
    canvas.Fill({.x = frame.x + frame.width * (static_cast<double>(n) + 0.1) /
                                    ReliabilityScore::kBins,
                 .y = frame.y + frame.height - height,
                 .width = 0.8 * frame.width / ReliabilityScore::kBins,
                 .height = height});
  }
  canvas.SetColor(kInk);
  canvas.Line(frame.x, frame.y + frame.height, frame.x + frame.width, frame.y,
              1);
  for (const ReliabilityScore::Bin& bin : score.bins()) {
    if (bin.count == 0) continue;
    canvas.SetColor(kLine);
    canvas.Fill({.x = frame.x + frame.width * bin.MeanStated() - 5,
                 .y = frame.y + frame.height * (1 - bin.Frequency()) - 5,
                 .width = 10,
                 .height = 10});
  }
}

void DrawNormalisedErrors(Canvas& canvas, const DepthEvaluation& depth) {
  constexpr int kBins = 32;
  constexpr double kEnd = 4;
  std::array<double, kBins> counts = {};
  double known = 0;
  for (const PlaceAnswer& place : depth.places) {
    if (!IsKnown(place)) continue;
    const double z = (place.mean_m - place.truth_m) / place.std_m;
    const double bin = std::floor((z + kEnd) / (2 * kEnd) * kBins);
    counts[static_cast<std::size_t>(std::clamp(bin, 0.0, kBins - 1.0))] += 1;
    known += 1;
  }
  constexpr double kBinWidth = 2 * kEnd / kBins;
  double top = 0.45;
  for (const double count : counts) {
    top = std::max(top, 1.05 * count / std::max(1.0, known) / kBinWidth);
  }
  const Rectangle frame = PanelFrame(2);
  const ValueScale x(-kEnd, kEnd, ValueScale::Kind::kLinear);
  const ValueScale y(0, top, ValueScale::Kind::kLinear);
  DrawAxes(canvas, frame,
           {.title = "Errors in stated deviations, and the normal curve",
            .across = "(map - truth) / stated deviation",
            .up = "up: density; the outer bars hold all beyond"},
           x, y);
  for (int n = 0; n < kBins; ++n) {
    const double density =
        counts[static_cast<std::size_t>(n)] / std::max(1.0, known) / kBinWidth;
    const double height = frame.height * y.Place(density);
    canvas.SetColor(kBar);
    canvas.Fill({.x = frame.x + frame.width * n / kBins,
                 .y = frame.y + frame.height - height,
                 .width = frame.width / kBins - 1,
                 .height = height});
  }
  constexpr int kSteps = 200;
  canvas.SetColor(kLine);
  const auto at = [&](int step) {
    const double z = -kEnd + 2 * kEnd * step / kSteps;
    const double density =
        std::exp(-z * z / 2) / std::sqrt(2 * std::numbers::pi);
    return std::array{frame.x + frame.width * x.Place(z),
                      frame.y + frame.height * (1 - y.Place(density))};
  };
  for (int step = 0; step < kSteps; ++step) {
    const auto [x0, y0] = at(step);
    const auto [x1, y1] = at(step + 1);
    canvas.Line(x0, y0, x1, y1, 2);
  }
}

absl::Status WriteText(const std::string& path, const std::string& text) {
  std::ofstream file(path, std::ios::trunc);
  file << text;
  file.close();
  if (file) return absl::OkStatus();
  return absl::PermissionDeniedError(
      absl::StrFormat("cannot write to %s", path));
}

std::string PlacesCsv(const DepthEvaluation& depth) {
  constexpr std::string_view kPrefix = "EVIDENCE_KIND_";
  std::string text = "north_m,east_m,truth_m,mean_m,std_m,kind\n";
  for (const PlaceAnswer& place : depth.places) {
    std::string kind = v1::EvidenceKind_Name(place.kind);
    if (kind.starts_with(kPrefix)) kind.erase(0, kPrefix.size());
    if (IsKnown(place)) {
      absl::StrAppendFormat(&text, "%.2f,%.2f,%.3f,%.3f,%.3f,%s\n",
                            place.north_m, place.east_m, place.truth_m,
                            place.mean_m, place.std_m, kind);
    } else {
      absl::StrAppendFormat(&text, "%.2f,%.2f,%.3f,,,%s\n", place.north_m,
                            place.east_m, place.truth_m, kind);
    }
  }
  return text;
}

std::string TracksCsv(const ContactEvaluation& contacts) {
  std::string text =
      "contact_id,at_s,truth_north_m,truth_east_m,north_m,east_m,"
      "variance_nn_m2,covariance_ne_m2,variance_ee_m2,nees\n";
  for (const ContactTrack& track : contacts.tracks) {
    for (const TrackPoint& point : track.points) {
      absl::StrAppendFormat(
          &text, "%s,%.3f,%.2f,%.2f,%.2f,%.2f,%.6g,%.6g,%.6g,%.4f\n",
          track.contact_id, point.at_s, point.truth.north_m, point.truth.east_m,
          point.estimate.north_m, point.estimate.east_m, point.covariance.nn,
          point.covariance.ne, point.covariance.ee,
          PositionNees(point.estimate.north_m - point.truth.north_m,
                       point.estimate.east_m - point.truth.east_m,
                       point.covariance));
    }
  }
  return text;
}

}  // namespace

absl::Status WriteEvaluation(const std::string& folder,
                             const std::string& title, const SurveyArea& area,
                             const DepthEvaluation& depth,
                             const ContactEvaluation& contacts) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  const std::filesystem::path path = folder;
  FATHOM_RETURN_IF_ERROR(WriteText((path / "evaluation.json").string(),
                                   EvaluationJson(depth, contacts) + "\n"));
  FATHOM_RETURN_IF_ERROR(
      WriteText((path / "places.csv").string(), PlacesCsv(depth)));
  if (!contacts.tracks.empty()) {
    FATHOM_RETURN_IF_ERROR(
        WriteText((path / "tracks.csv").string(), TracksCsv(contacts)));
    FATHOM_RETURN_IF_ERROR(
        DrawTracks((path / "tracks.png").string(), title, contacts));
  }
  Canvas canvas(kWidth, kHeight);
  canvas.Text(title, kLeft, 38, {.size = 20, .bold = true});
  DrawErrors(canvas, area, depth);
  DrawReliability(canvas, depth);
  DrawNormalisedErrors(canvas, depth);
  return canvas.WritePng((path / "evaluation.png").string());
}

}  // namespace fathom::feeder
