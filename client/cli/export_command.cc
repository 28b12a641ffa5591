// fathom export: the map as a raster file for other programs.

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "client/cli/cell_layers.h"
#include "client/cli/exit_code.h"
#include "client/cli/map_area.h"
#include "client/cli/progress_bar.h"
#include "client/cli/raster_writer.h"
#include "client/cli/session.h"
#include "client/cli/text.h"

namespace fathom::client::cli {
namespace {

struct ExportFlags {
  std::string out;
  std::string format = "cog";
  AreaFlags area;
  double resolution_m = 0;
  std::string bands = "depth,uncertainty";
  std::string crs;
};

absl::StatusOr<ExportFormat> FormatOf(const std::string& name) {
  if (name == "bag") return ExportFormat::kBag;
  if (name == "tif") return ExportFormat::kTif;
  return ExportFormat::kCog;
}

// Depth and uncertainty always come first, whatever was named.
absl::StatusOr<std::vector<ExportBand>> BandsOf(const std::string& list) {
  std::vector<ExportBand> bands = {ExportBand::kDepth,
                                   ExportBand::kUncertainty};
  constexpr std::array kAll = {ExportBand::kDepth, ExportBand::kUncertainty,
                               ExportBand::kShoalest, ExportBand::kAge,
                               ExportBand::kLayer};
  for (const std::string& name : SplitList(list, ',')) {
    const auto* band = std::find_if(
        kAll.begin(), kAll.end(),
        [&](ExportBand candidate) { return name == BandName(candidate); });
    if (band == kAll.end()) {
      return UsageError(absl::InvalidArgumentError(absl::StrFormat(
          "bands: \"%s\" is none; choose from depth, uncertainty, shoalest, "
          "age, layer",
          name)));
    }
    if (std::find(bands.begin(), bands.end(), *band) == bands.end()) {
      bands.push_back(*band);
    }
  }
  return bands;
}

// The resolution asked for, or the finest that there is and that one answer
// can hold.
absl::StatusOr<double> ChooseResolution(
    const ExportFlags& flags, const MapArea& area,
    const v1::GetMissionStatusResponse& status) {
  const double most =
      status.limits().max_region_cells() > 0
          ? static_cast<double>(status.limits().max_region_cells())
          : static_cast<double>(kMaxRegionCells);
  // A little above the coarsest that fits, rounded up to two digits.
  const auto fitting = [&](double from_m) {
    double resolution_m = from_m;
    while (area.Cells(resolution_m) > most) {
      const double factor = std::sqrt(area.Cells(resolution_m) / most) * 1.001;
      const double power =
          std::pow(10, std::floor(std::log10(resolution_m * factor)) - 1);
      resolution_m = std::ceil(resolution_m * factor / power) * power;
    }
    return resolution_m;
  };
  if (flags.resolution_m > 0) {
    if (area.Cells(flags.resolution_m) > most) {
      return UsageError(absl::InvalidArgumentError(absl::StrFormat(
          "resolution_m=%g: %s cells are more than the server gives at once "
          "(%s): use --resolution-m %g, or a smaller area",
          flags.resolution_m,
          CountText(static_cast<std::uint64_t>(area.Cells(flags.resolution_m))),
          CountText(static_cast<std::uint64_t>(most)),
          fitting(flags.resolution_m))));
    }
    return flags.resolution_m;
  }
  const double finest_m = std::max(
      0.1, area.cell_m > 0 ? area.cell_m : status.global_map().min_cell_m());
  const double resolution_m = fitting(finest_m);
  if (resolution_m > finest_m) {
    Note(absl::StrFormat(
        "cells of %g m: as fine as one answer holds; the map's own are %g m (a "
        "smaller area shows them; the band shoalest keeps what lies between)",
        resolution_m, finest_m));
  }
  return resolution_m;
}

struct Counts {
  std::uint64_t known = 0;
  std::uint64_t land = 0;
  std::uint64_t unknown = 0;
  double min_depth_m = std::numeric_limits<double>::infinity();
  double max_depth_m = -std::numeric_limits<double>::infinity();
};

Counts Count(const Region& region) {
  Counts counts;
  for (std::size_t i = 0; i < region.depth_m.size(); ++i) {
    const double depth_m = region.depth_m[i];
    if (region.kind[i] == v1::EVIDENCE_KIND_LAND) {
      ++counts.land;
    } else if (std::isfinite(depth_m)) {
      ++counts.known;
      counts.min_depth_m = std::min(counts.min_depth_m, depth_m);
      counts.max_depth_m = std::max(counts.max_depth_m, depth_m);
    } else {
      ++counts.unknown;
    }
  }
  return counts;
}

void Print(const Session& session, const ExportOptions& options,
           const ExportSummary& summary, const Region& region,
           const Counts& counts) {
  if (session.json) {
    nlohmann::ordered_json json;
    json["file"] = options.path;
    json["driver"] = summary.driver;
    json["file_bytes"] = summary.file_bytes;
    json["crs"] = summary.crs;
    json["columns"] = summary.columns;
    json["rows"] = summary.rows;
    json["resolution_m"] = options.resolution_m;
    json["bands"] = nlohmann::ordered_json::array();
    for (const ExportBand band : options.bands) {
      json["bands"].push_back(BandName(band));
    }
    json["vertical_datum"] = options.vertical_datum;
    json["cells_known"] = counts.known;
    json["cells_land"] = counts.land;
    json["cells_unknown"] = counts.unknown;
    json["min_depth_m"] = nullptr;
    json["max_depth_m"] = nullptr;
    if (counts.known > 0) {
      json["min_depth_m"] = counts.min_depth_m;
      json["max_depth_m"] = counts.max_depth_m;
    }
    json["stamp"] = ToJson(region.stamp);
    PrintJson(json);
    return;
  }
  cli::Print(absl::StrFormat("%s   %s, %s, %d x %d cells of %g m in %s\n",
                             options.path, summary.driver,
                             BytesText(summary.file_bytes), summary.columns,
                             summary.rows, options.resolution_m, summary.crs));
  cli::Print(absl::StrFormat("map    %s cells known, %s land, %s unknown",
                             CountText(counts.known), CountText(counts.land),
                             CountText(counts.unknown)));
  if (counts.known > 0) {
    cli::Print(absl::StrFormat("; depths %.2f to %.2f m below %s",
                               counts.min_depth_m, counts.max_depth_m,
                               options.vertical_datum));
  }
  cli::Print("\n");
}

absl::Status Run(const Session& session, const ExportFlags& flags) {
  ExportOptions options;
  options.path = flags.out;
  options.crs = flags.crs;
  FATHOM_ASSIGN_OR_RETURN(options.format, FormatOf(flags.format));
  FATHOM_ASSIGN_OR_RETURN(options.bands, BandsOf(flags.bands));
  if (options.bands.size() > 2 && options.format != ExportFormat::kCog) {
    return UsageError(absl::InvalidArgumentError(
        "bands: only --format cog holds more than depth and uncertainty"));
  }
  FATHOM_ASSIGN_OR_RETURN(const std::unique_ptr<Client> client,
                          session.Connect());
  FATHOM_ASSIGN_OR_RETURN(const v1::GetMissionStatusResponse status,
                          client->GetMissionStatus());
  FATHOM_ASSIGN_OR_RETURN(const MapArea area,
                          ChooseArea(flags.area, 0, status));
  FATHOM_ASSIGN_OR_RETURN(options.resolution_m,
                          ChooseResolution(flags, area, status));
  options.mission = status.name();
  options.vertical_datum = status.vertical_datum();
  const v1::GetRegionRequest request =
      RegionRequest(area.box, options.resolution_m);

  const auto cells =
      static_cast<std::uint64_t>(area.Cells(options.resolution_m));
  ProgressBar fetching("read ", "cells", cells);
  FATHOM_ASSIGN_OR_RETURN(
      const Region region,
      client->GetRegion(request, [&](std::uint64_t done, std::uint64_t) {
        fetching.Update(done);
      }));
  fetching.Finish();
  const Counts counts = Count(region);
  if (counts.known + counts.land == 0) {
    return absl::NotFoundError(
        "the map knows nothing in this area: nothing was written (fathom "
        "status tells what it holds; choose with --area or --activity)");
  }
  ExportInput input{.region = region};
  if (std::find(options.bands.begin(), options.bands.end(),
                ExportBand::kLayer) != options.bands.end()) {
    FATHOM_ASSIGN_OR_RETURN(input.layers,
                            FetchCellLayers(*client, status, request, region));
  }
  ProgressBar writing("write", "cells", cells);
  options.progress = [&](double share) {
    writing.Update(
        static_cast<std::uint64_t>(share * static_cast<double>(cells)));
  };
  FATHOM_ASSIGN_OR_RETURN(const ExportSummary summary,
                          WriteRaster(input, options));
  writing.Finish();
  Print(session, options, summary, region, counts);
  return absl::OkStatus();
}

}  // namespace

void AddExport(CLI::App& app, Session& session) {
  CLI::App* verb = app.add_subcommand(
      "export", "The map as a raster file: GeoTIFF (COG) or BAG");
  const auto f = std::make_shared<ExportFlags>();
  verb->add_option("--out,-o", f->out,
                   "The file to write; one that exists is replaced when the "
                   "new one is whole")
      ->required();
  verb->add_option("--format", f->format,
                   "cog: Cloud Optimized GeoTIFF with depth (positive down) "
                   "and uncertainty; bag: Bathymetric Attributed Grid; tif: "
                   "GeoTIFF laid out as a BAG (elevation, uncertainty)")
      ->check(CLI::IsMember({"cog", "bag", "tif"}))
      ->capture_default_str();
  AddAreaFlags(*verb, f->area);
  verb->add_option("--resolution-m,--resolution", f->resolution_m,
                   "Side of a cell, metres (default: the map's finest, or as "
                   "fine as one answer holds)")
      ->check(CLI::PositiveNumber);
  verb->add_option("--bands", f->bands,
                   "Of depth,uncertainty,shoalest,age,layer; the first two "
                   "are always there")
      ->capture_default_str();
  verb->add_option("--crs", f->crs,
                   "Coordinate reference system of the file, e.g. EPSG:32619, "
                   "or utm (default: WGS 84 latitude and longitude)");
  verb->footer(
      "\nDepths are metres below the mission's vertical datum, uncertainties "
      "are 1 sigma.\nUnknown cells are nodata. Land has no depth and an "
      "uncertainty of 0. With --crs each\ncell takes the values of the "
      "nearest one: nothing is averaged, but here and there a\ncell shows "
      "twice or not at all; the default grid shows each once.\nWithout an "
      "area: the newest activity's, or the whole mission.\n"
      "\nExamples:\n"
      "  fathom export --activity bay --out bay.tif\n"
      "  fathom export --area 41.2,-71.6,41.9,-71.0 --resolution-m 50 -o "
      "bay.tif\n"
      "  fathom export --format bag --crs utm --activity bay -o bay.bag\n"
      "  fathom export --bands depth,uncertainty,shoalest,layer -o all.tif");
  verb->callback([&session, f]() {
    session.run = [&session, f]() { return Run(session, *f); };
  });
}

}  // namespace fathom::client::cli
