// fathom prior: a-priori charts into the map.

#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "client/cli/exit_code.h"
#include "client/cli/geo_math.h"
#include "client/cli/import_id.h"
#include "client/cli/progress_bar.h"
#include "client/cli/raster.h"
#include "client/cli/session.h"
#include "client/cli/text.h"
#include "client/proto_time.h"

namespace fathom::client::cli {
namespace {

// Cells of one tile at most, whatever the server would take: 256 x 256 cells
// are 0.6 MB and some milliseconds of the server's writer.
constexpr std::int64_t kTileCells = 256 * 256;

struct ImportFlags {
  RasterOptions raster;
  std::string positive = "auto";
  int std_95_band = 0;
  std::string name;
  std::string survey_time;
  bool merge = false;
  bool no_clip = false;
  bool dry_run = false;
  bool again = false;
};

nlohmann::ordered_json SummaryJson(const DepthRaster& raster) {
  const RasterSummary& s = raster.summary();
  const RasterCounts& c = raster.counts();
  nlohmann::ordered_json json;
  json["driver"] = s.driver;
  json["crs"] = s.crs;
  json["source_columns"] = s.source_columns;
  json["source_rows"] = s.source_rows;
  json["positive"] = s.positive == Positive::kUp ? "up" : "down";
  json["positive_reason"] = s.positive_reason;
  json["std"] = s.std_source;
  json["remarks"] = s.remarks;
  json["columns"] = raster.grid().columns;
  json["rows"] = raster.grid().rows;
  json["latitude_step_deg"] = raster.grid().latitude_step_deg;
  json["longitude_step_deg"] = raster.grid().longitude_step_deg;
  json["cells_with_depth"] = c.with_depth;
  json["cells_land"] = c.land;
  json["cells_unknown"] = c.unknown;
  json["cells_implausible"] = c.implausible;
  json["cells_without_std"] = c.without_std;
  return json;
}

void NoteDecisions(const std::string& path, const DepthRaster& raster) {
  const RasterSummary& s = raster.summary();
  const LonLatGrid& grid = raster.grid();
  Note(absl::StrFormat("chart      %s: %s, %d x %d cells, %s", path, s.driver,
                       s.source_columns, s.source_rows,
                       s.crs.empty() ? "unnamed system" : s.crs));
  Note(absl::StrFormat(
      "values     positive %s: %s",
      s.positive == Positive::kUp ? "up (elevations)" : "down (depths)",
      s.positive_reason));
  Note("std        " + s.std_source);
  Note(absl::StrFormat("reads      %s x %s cells of %.3g x %.3g arc seconds",
                       CountText(static_cast<std::uint64_t>(grid.columns)),
                       CountText(static_cast<std::uint64_t>(grid.rows)),
                       grid.longitude_step_deg * 3600,
                       grid.latitude_step_deg * 3600));
  for (const std::string& remark : s.remarks) Note("remark     " + remark);
}

absl::StatusOr<v1::PriorHeader> Header(const Session& session,
                                       const ImportFlags& flags,
                                       const DepthRaster& raster) {
  v1::PriorHeader header;
  header.set_name(
      flags.name.empty()
          ? std::filesystem::path(flags.raster.path).filename().string()
          : flags.name);
  header.set_expected_cells(static_cast<std::uint64_t>(raster.grid().rows) *
                            static_cast<std::uint64_t>(raster.grid().columns));
  header.mutable_vertical_reference()->set_reference(
      v1::DEPTH_REFERENCE_MISSION_DATUM);
  header.set_replace(!flags.merge);
  if (!flags.survey_time.empty()) {
    FATHOM_ASSIGN_OR_RETURN(const Time time,
                            ParseMoment(flags.survey_time, session.Now()));
    *header.mutable_survey_time() = ToProto(time);
  }
  return header;
}

// Whether the tile says anything.
bool SaysSomething(const RasterCounts& before, const RasterCounts& after) {
  return after.with_depth > before.with_depth || after.land > before.land;
}

// What an import did.
struct Sent {
  // None: nothing had to be sent.
  std::optional<v1::ImportPriorResponse> response = std::nullopt;
  // Tiles of the chart, and those of them that the mission held before.
  std::uint64_t tiles = 0;
  std::uint64_t tiles_held = 0;
};

// What broke off an import, with what to do: the tiles that became durable
// are not sent again.
absl::Status BrokenOff(const absl::Status& status) {
  if (ExitCodeOf(status) != ExitCode::kUnreachable) return status;
  return absl::Status(
      status.code(),
      absl::StrFormat("%s; the import broke off: run the same command again "
                      "and it goes on where the mission stands",
                      std::string(status.message())));
}

// Sends every block that says something and that the mission does not hold
// yet; the writer is opened with the first. Without a client nothing is sent.
absl::StatusOr<Sent> Send(const Client* client, v1::PriorHeader header,
                          std::int64_t max_tile_cells, DepthRaster& raster) {
  Sent sent;
  if (client != nullptr) {
    FATHOM_ASSIGN_OR_RETURN(sent.tiles_held,
                            client->GetImport(header.import_id()));
    if (sent.tiles_held > 0) {
      Note(
          absl::StrFormat("resume     the mission holds the first %s tiles "
                          "of this chart: they are not sent again",
                          CountText(sent.tiles_held)));
    }
    header.set_first_tile(sent.tiles_held + 1);
  }
  std::unique_ptr<PriorWriter> writer;
  ProgressBar progress("import", "cells", header.expected_cells());
  std::uint64_t done = 0;
  for (const GridBlock& block : CutIntoBlocks(raster.grid(), max_tile_cells)) {
    const RasterCounts before = raster.counts();
    FATHOM_ASSIGN_OR_RETURN(const v1::DepthTile tile, raster.Read(block));
    if (SaysSomething(before, raster.counts())) {
      ++sent.tiles;
      if (client != nullptr && sent.tiles > sent.tiles_held) {
        if (writer == nullptr) {
          FATHOM_ASSIGN_OR_RETURN(writer, client->ImportPrior(header));
        }
        const absl::Status written = writer->Write(tile);
        if (!written.ok()) return BrokenOff(written);
      }
    }
    done += static_cast<std::uint64_t>(block.rows * block.columns);
    progress.Update(done);
  }
  progress.Finish();
  const RasterCounts& counts = raster.counts();
  if (counts.with_depth + counts.land == 0) {
    return FileError(absl::InvalidArgumentError(
        counts.without_std > 0
            ? absl::StrFormat("%s cells have a depth, but none has an "
                              "uncertainty of its own: say how good the chart "
                              "is with --std-m",
                              CountText(counts.without_std))
            : "no cell in the area has a depth or is land: nothing was "
              "imported"));
  }
  if (writer != nullptr) {
    absl::StatusOr<v1::ImportPriorResponse> response = writer->Finish();
    if (!response.ok()) return BrokenOff(response.status());
    sent.response = *std::move(response);
  }
  return sent;
}

std::string CountsText(const RasterCounts& c) {
  std::string text = absl::StrFormat("%s cells with depth, %s land, %s unknown",
                                     CountText(c.with_depth), CountText(c.land),
                                     CountText(c.unknown));
  if (c.implausible > 0) {
    absl::StrAppendFormat(&text, " (%s of them hold a value that is no depth)",
                          CountText(c.implausible));
  }
  if (c.without_std > 0) {
    absl::StrAppendFormat(&text, " (%s of them have a depth but no std)",
                          CountText(c.without_std));
  }
  return text;
}

void PrintOutcome(const Session& session, const v1::PriorHeader& header,
                  const DepthRaster& raster, const Sent& sent, bool dry_run) {
  const bool already = !dry_run && !sent.response.has_value();
  if (session.json) {
    nlohmann::ordered_json document;
    document["chart"] = SummaryJson(raster);
    document["chart"]["tiles"] = sent.tiles;
    if (!dry_run) {
      document["import_id"] = header.import_id();
      document["tiles_held_before"] = sent.tiles_held;
      document["already_loaded"] = already;
    }
    if (sent.response.has_value()) document["import"] = ToJson(*sent.response);
    PrintJson(document);
    return;
  }
  Print("chart      " + CountsText(raster.counts()) + "\n");
  if (dry_run) {
    Print("dry run    nothing was sent\n");
  } else if (already) {
    Print(
        "unchanged  the mission holds all of this chart already: nothing was "
        "sent (--again loads it anew)\n");
  } else {
    const v1::ImportPriorResponse& response = *sent.response;
    Print(absl::StrFormat(
        "imported   %s tiles%s; %s cells lie outside the mission; global map "
        "%s -> %s leaves; revision %d\n",
        CountText(response.tiles()),
        sent.tiles_held == 0
            ? ""
            : absl::StrFormat(" (%s were there)", CountText(sent.tiles_held)),
        CountText(response.cells_outside()),
        CountText(response.leaves_before()), CountText(response.leaves_after()),
        response.map_revision()));
  }
}

absl::Status Import(const Session& session, ImportFlags flags) {
  flags.raster.positive = flags.positive == "up"     ? Positive::kUp
                          : flags.positive == "down" ? Positive::kDown
                                                     : Positive::kAuto;
  if (flags.std_95_band != 0) {
    flags.raster.std_band = flags.std_95_band;
    flags.raster.std_is_95_percent = true;
  }
  std::unique_ptr<Client> client;
  std::int64_t max_tile_cells = kTileCells;
  if (!flags.dry_run) {
    FATHOM_ASSIGN_OR_RETURN(client, session.Connect());
    FATHOM_ASSIGN_OR_RETURN(const v1::GetMissionStatusResponse status,
                            client->GetMissionStatus());
    if (status.limits().max_tile_cells() > 0) {
      max_tile_cells =
          static_cast<std::int64_t>(status.limits().max_tile_cells());
    }
    if (!flags.no_clip) {
      flags.raster.clip = MissionBox(status.global_map().south_west(),
                                     status.global_map().north_west());
    }
  }
  FATHOM_ASSIGN_OR_RETURN(const std::unique_ptr<DepthRaster> raster,
                          DepthRaster::Open(flags.raster));
  NoteDecisions(flags.raster.path, *raster);
  FATHOM_ASSIGN_OR_RETURN(v1::PriorHeader header,
                          Header(session, flags, *raster));
  const std::int64_t tile_cells = std::min(kTileCells, max_tile_cells);
  if (client != nullptr) {
    FATHOM_ASSIGN_OR_RETURN(
        std::string id,
        ImportId(flags.raster, raster->files(), header, tile_cells));
    if (flags.again) {
      // Another name: the mission does not know it.
      Digest digest;
      digest.AddField(id);
      digest.AddField(FormatTime(session.Now()));
      id = "prior-" + digest.Hex();
    }
    header.set_import_id(id);
  }
  FATHOM_ASSIGN_OR_RETURN(const Sent sent,
                          Send(client.get(), header, tile_cells, *raster));
  PrintOutcome(session, header, *raster, sent, flags.dry_run);
  return absl::OkStatus();
}

}  // namespace

void AddPrior(CLI::App& app, Session& session) {
  CLI::App* verb =
      app.add_subcommand("prior", "A-priori charts: import a raster");
  verb->require_subcommand(1);
  CLI::App* import = verb->add_subcommand(
      "import", "Load a raster of depths or elevations as a-priori map");
  const auto f = std::make_shared<ImportFlags>();
  import
      ->add_option("FILE", f->raster.path,
                   "Any raster GDAL reads: GeoTIFF, BAG, netCDF, ASCII grid")
      ->required();
  import
      ->add_option("--positive", f->positive,
                   "up: values are elevations; down: values are depths; "
                   "auto: as the file says, refused if it does not")
      ->check(CLI::IsMember({"auto", "up", "down"}))
      ->capture_default_str();
  import
      ->add_option("--std-m", f->raster.std_m,
                   "How good the chart is: 1 sigma, metres; beside a std "
                   "band, for cells without their own")
      ->check(CLI::PositiveNumber);
  CLI::Option* std_band =
      import->add_option("--std-band", f->raster.std_band,
                         "Band with the std of each cell, 1 sigma (default: "
                         "the one described as uncertainty)");
  import
      ->add_option("--std-95-band", f->std_95_band,
                   "Band with a 95 % uncertainty: divided by 1.96")
      ->excludes(std_band);
  import->add_option("--band", f->raster.depth_band,
                     "Band with the depths (default: the one described as "
                     "elevation or depth, else 1)");
  import
      ->add_option("--land-above", f->raster.land_above_m,
                   "Higher than this above the datum is land, metres")
      ->capture_default_str();
  import->add_option("--crs", f->raster.crs,
                     "Coordinate reference system, e.g. EPSG:32619, instead "
                     "of the file's");
  import->add_flag("--bag-overview", f->raster.overview_grid,
                   "Of a variable-resolution BAG, only the coarse overview "
                   "grid (may hide rocks)");
  import->add_option("--name", f->name,
                     "Name of the chart (default: the file's)");
  import->add_option("--survey-time", f->survey_time,
                     "When it was surveyed, e.g. 2019-11-04T00:00:00Z");
  import->add_flag("--merge", f->merge,
                   "Fuse with earlier charts as independent knowledge instead "
                   "of replacing them; measurements are never replaced");
  import->add_flag("--no-clip", f->no_clip,
                   "Send all of it, also what lies outside the mission");
  import->add_flag("--again", f->again,
                   "Load it anew although the mission holds it already (as "
                   "after another chart replaced it)");
  import->add_flag("--dry-run", f->dry_run,
                   "Read it and say what would be sent, without a server");
  import->footer(
      "\nThe file's vertical datum must be the mission's (fathom mission "
      "info). Land stays\nland and nodata stays unknown: neither becomes a "
      "depth. The uncertainty of a BAG is\nread as its metadata says (product "
      "uncertainty: 95 %); --std-band and --std-95-band\noverrule it.\n"
      "\nAn import that broke off is resumed by the same command: the chart's "
      "content and the\noptions name it. Loading the same chart twice changes "
      "nothing.\n"
      "\nExamples:\n"
      "  fathom prior import etopo5.cdf --positive up --std-m 10\n"
      "  fathom prior import F00788_SR_8m.bag --std-95-band 2\n"
      "  fathom prior import survey.tif --dry-run --std-m 0.5");
  import->callback([&session, f]() {
    session.run = [&session, f]() { return Import(session, *f);
};
}  // namespace fathom::client::cli
);
}

}  // namespace fathom::client::cli
