#include "sim_feeder/evaluation_report.h"

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "absl/strings/str_format.h"

namespace fathom::feeder {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::array<std::pair<v1::EvidenceKind, const char*>, 3> kKinds = {{
    {v1::EVIDENCE_KIND_MEASURED, "measured"},
    {v1::EVIDENCE_KIND_SMOOTHED, "smoothed"},
    {v1::EVIDENCE_KIND_PRIOR, "prior"},
}};

// Figures for people and scripts alike: no more digits than mean something.
double Rounded(double value) {
  if (!std::isfinite(value)) return value;
  return std::round(value * 1e5) / 1e5;
}

DepthScore ScoreOf(const DepthEvaluation& depth, v1::EvidenceKind kind) {
  const auto found = depth.by_kind.find(kind);
  return found == depth.by_kind.end() ? DepthScore() : found->second;
}

Json DepthJson(const DepthScore& score) {
  return {{"count", score.count()},
          {"rmse_m", Rounded(score.RmseM())},
          {"bias_m", Rounded(score.BiasM())},
          {"mean_std_m", Rounded(score.MeanStdM())},
          {"within_1std", Rounded(score.ShareWithin(1))},
          {"within_2std", Rounded(score.ShareWithin(2))},
          {"within_3std", Rounded(score.ShareWithin(3))},
          {"nees", Rounded(score.MeanNees())}};
}

Json ContactJson(const ContactScore& score) {
  return {{"count", score.count()},
          {"rmse_m", Rounded(score.RmseM())},
          {"nees", Rounded(score.MeanNees())},
          {"within_95", Rounded(score.ShareWithin95())}};
}

Json ReliabilityJson(const ReliabilityScore& score) {
  Json bins = Json::array();
  for (std::size_t i = 0; i < ReliabilityScore::kBins; ++i) {
    const ReliabilityScore::Bin& bin = score.bins()[i];
    const double width = 1.0 / static_cast<double>(ReliabilityScore::kBins);
    bins.push_back({{"from", Rounded(width * static_cast<double>(i))},
                    {"to", Rounded(width * static_cast<double>(i + 1))},
                    {"count", bin.count},
                    {"stated", Rounded(bin.MeanStated())},
                    {"observed", Rounded(bin.Frequency())}});
  }
  return bins;
}

}  // namespace

std::string EvaluationJson(const DepthEvaluation& depth,
                           const ContactEvaluation& contacts) {
  Json json = {{"points", depth.points},
               {"without_truth", depth.without_truth},
               {"unknown", depth.unknown},
               {"unknown_share", Rounded(static_cast<double>(depth.unknown) /
                                         static_cast<double>(depth.points))},
               {"land_right", depth.land_right},
               {"land_wrong", depth.land_wrong}};
  for (const auto& [kind, name] : kKinds) {
    json[name] = DepthJson(ScoreOf(depth, kind));
  }
  json["obstacles"] = {
      {"count", depth.reliability.count()},
      {"near_contact", depth.near_contact},
      {"brier", Rounded(depth.reliability.Brier())},
      {"calibration_error", Rounded(depth.reliability.CalibrationError())},
      {"reliability", ReliabilityJson(depth.reliability)}};
  json["contacts"] = ContactJson(contacts.during);
  json["contacts"]["missing"] = contacts.missing;
  json["contacts"]["predicted"] = Json::array();
  for (const auto& [horizon_s, score] : contacts.predicted) {
    Json entry = {{"horizon_s", horizon_s}};
    entry.update(ContactJson(score));
    json["contacts"]["predicted"].push_back(entry);
  }
  return json.dump();
}

std::string EvaluationTable(const DepthEvaluation& depth,
                            const ContactEvaluation& contacts) {
  std::string text = absl::StrFormat(
      "%d places: %d unknown, %d without truth, land right %d wrong %d\n"
      "%-10s %8s %8s %8s %8s %7s %7s %7s\n",
      depth.points, depth.unknown, depth.without_truth, depth.land_right,
      depth.land_wrong, "depth", "count", "rmse_m", "bias_m", "std_m", "1 std",
      "2 std", "3 std");
  for (const auto& [kind, name] : kKinds) {
    const DepthScore score = ScoreOf(depth, kind);
    text += absl::StrFormat(
        "%-10s %8d %8.3f %8.3f %8.3f %6.1f%% %6.1f%% %6.1f%%\n", name,
        score.count(), score.RmseM(), score.BiasM(), score.MeanStdM(),
        100.0 * score.ShareWithin(1), 100.0 * score.ShareWithin(2),
        100.0 * score.ShareWithin(3));
  }
  text += absl::StrFormat("%-45s %6.1f%% %6.1f%% %6.1f%%\n", "(calibrated)",
                          68.3, 95.4, 99.7);
  text += absl::StrFormat(
      "obstacles: %d answers, Brier %.4f, calibration error %.4f\n"
      "  stated     count  mean   came true\n",
      depth.reliability.count(), depth.reliability.Brier(),
      depth.reliability.CalibrationError());
  for (std::size_t i = 0; i < ReliabilityScore::kBins; ++i) {
    const ReliabilityScore::Bin& bin = depth.reliability.bins()[i];
    text += absl::StrFormat("  %.1f-%.1f %8d  %.3f  %.3f\n",
                            0.1 * static_cast<double>(i),
                            0.1 * static_cast<double>(i + 1), bin.count,
                            bin.MeanStated(), bin.Frequency());
  }
  text += absl::StrFormat(
      "contacts: %d estimates, rmse_m %.2f, NEES %.2f (2 expected), %.1f %% "
      "inside "
      "95 %%, missing %d\n",
      contacts.during.count(), contacts.during.RmseM(),
      contacts.during.MeanNees(), 100.0 * contacts.during.ShareWithin95(),
      contacts.missing);
  for (const auto& [horizon_s, score] : contacts.predicted) {
    text += absl::StrFormat("  +%4d s: rmse_m %.2f, NEES %.2f, %.1f %%\n",
                            horizon_s, score.RmseM(), score.MeanNees(),
                            100.0 * score.ShareWithin95());
  }
  return text;
}

}  // namespace fathom::feeder
