// Prints the accuracy figures of the map and writes them as JSON.
//
//   accuracy --data DIR [--seeds N] [--only FIGURE] [--check] [--draw DIR]
//            --out FILE

#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>

#include "tests/accuracy/contacts.h"
#include "tests/accuracy/figures.h"
#include "tests/accuracy/limits.h"
#include "tests/accuracy/thesis_local.h"
#include "tests/accuracy/thesis_picture.h"
#include "tests/accuracy/thesis_scene.h"

namespace fathom::accuracy {
namespace {

std::vector<Scene> Scenes(const std::string& data) {
  std::vector<Scene> scenes;
  const auto add = [&](std::string name, const std::string& file, double cell_m,
                       int cells) {
    const std::string path = data + "/bathymetry/" + file;
    auto terrain = Terrain::FromRaster(path, true);
    if (!terrain.ok()) {
      std::printf("skipped: %s\n", terrain.status().ToString().c_str());
      return;
    }
    scenes.push_back({.name = std::move(name),
                      .terrain = *std::move(terrain),
                      .cell_m = cell_m,
                      .cells = cells});
  };
  // Cells are five (three) nodes of the raster wide.
  add("coast", "woods_hole_buzzards_10m_utm19.tif", 50, 16);
  add("inlet", "wadden_sea_30m_utm31.tif", 150, 16);
  add("slope", "F00788_SR_8m.tif", 24, 8);
  add("flat", "JD211_public_Release_1-4_UTM.bag", 10, 16);
  scenes.push_back({.name = "fractal",
                    .terrain = Terrain::Fractal(1, 2, 30, 4),
                    .cell_m = 10,
                    .cells = 16});
  return scenes;
}

// The scene of the thesis on a terrain of 10 m: one row.
nlohmann::json ThesisSceneFigures(const Terrain& terrain) {
  const ThesisScene scene = MeasureThesisScene(terrain, 200);
  return nlohmann::json::array(
      {{{"windows", scene.windows},
        {"median_leaves", scene.median_leaves},
        {"median_bytes", scene.median_bytes},
        {"most_bytes", scene.most_bytes},
        {"worst_m", scene.worst_m},
        {"as_printed_median_leaves", scene.pairwise_median_leaves},
        {"as_printed_worst_m", scene.pairwise_worst_m},
        {"flat_median_leaves", scene.flat_median_leaves}}});
}

// One line a row: every scalar of the row.
void Print(const std::string& title, const nlohmann::json& rows) {
  std::printf("\n%s\n", title.c_str());
  for (const nlohmann::json& row : rows) {
    std::string line;
    for (const auto& [key, value] : row.items()) {
      if (value.is_structured()) continue;
      char text[64];
      if (value.is_number_float()) {
        std::snprintf(text, sizeof text, "%.4g", value.get<double>());
      } else if (value.is_string()) {
        std::snprintf(text, sizeof text, "%s",
                      value.get<std::string>().c_str());
      } else {
        std::snprintf(text, sizeof text, "%s", value.dump().c_str());
      }
      line += "  " + key + "=" + text;
    }
    std::printf("%s\n", line.c_str());
  }
}

int Run(int argc, char** argv) {
  CLI::App app("Accuracy of the map against truth it has never seen");
  std::string data;
  std::string out;
  std::string only;
  std::string draw;
  bool check = false;
  int seeds = 20;
  app.add_option("--data", data, "folder of the test data")->required();
  app.add_option("--out", out, "JSON file to write")->required();
  app.add_option("--seeds", seeds, "surveys per figure")
      ->check(CLI::Range(1, 1000));
  app.add_option("--only", only, "the figures whose names begin so");
  app.add_flag("--check", check, "exit 1 if a figure misses its limit");
  app.add_option("--draw", draw, "folder for the pictures of docs/results.md")
      ->check(CLI::ExistingDirectory);
  CLI11_PARSE(app, argc, argv);

  const std::vector<Scene> scenes = Scenes(data);
  const std::vector<std::pair<std::string, std::function<nlohmann::json()>>>
      figures = {
          {"optimal", [&] { return OptimalFigures(seeds); }},
          {"coverage", [&] { return CoverageFigures(scenes, seeds); }},
          {"smoothed", [&] { return SmoothedFigures(scenes, seeds); }},
          {"reliability", [&] { return ReliabilityFigures(scenes, seeds); }},
          {"bad_prior", [&] { return BadPriorFigures(scenes, seeds); }},
          {"hazards",
           [&] {
             return HazardFigures(data + "/charts", scenes.front().terrain,
                                  seeds);
           }},
          {"hazard_cost", [&] { return HazardCostFigures(scenes, seeds); }},
          {"thesis_local",
           [&] {
             return scenes.front().name == "coast"
                        ? ThesisLocalFigures(scenes.front().terrain, seeds)
                        : nlohmann::json::array();
           }},
          {"thesis_scene",
           [&] {
             // The first scene is Woods Hole where it lies.
             return scenes.front().name == "coast"
                        ? ThesisSceneFigures(scenes.front().terrain)
                        : nlohmann::json::array();
           }},
          {"recorded",
           [&] {
             return RecordedFigures(
                 data + "/soundings/r2sonic2026_sf_every8th_ping.csv.gz");
           }},
          {"contact_reference",
           [&] { return ContactReferenceFigures(data + "/reference"); }},
          {"contact_consistency", ContactConsistencyFigures},
          {"contact_optimum", ContactOptimumFigures},
          {"contact_prediction", ContactPredictionFigures},
          {"contact_past", ContactPastFigures},
          {"contact_thesis", ThesisContactFigures},
          {"contact_recorded",
           [&] { return RecordedContactFigures(data + "/contacts"); }},
      };
  nlohmann::json report = {{"seeds", seeds}};
  for (const auto& [name, make] : figures) {
    if (!only.empty() && !name.starts_with(only)) continue;
    report[name] = make();
    Print(name, report[name]);
  }
  std::filesystem::create_directories(
      std::filesystem::absolute(out).parent_path());
  std::ofstream(out) << report.dump(2) << "\n";
  if (!draw.empty()) {
    int pictures = DrawThesisContact(draw);
    if (scenes.front().name == "coast") {
      const Terrain& coast = scenes.front().terrain;
      pictures += DrawThesisLocal(coast, draw + "/fig_6_1.png");
      pictures += DrawThesisScene(coast, draw + "/global_scene.png");
    }
    std::printf("\n%d pictures in %s\n", pictures, draw.c_str());
  }
  const int missed = CheckLimits(report) + CheckContactLimits(report);
  return check && missed > 0 ? 1 : 0;
}

}  // namespace
}  // namespace fathom::accuracy

int main(int argc, char** argv) { return fathom::accuracy::Run(argc, argv); }
