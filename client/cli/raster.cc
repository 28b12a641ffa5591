#include "client/cli/raster.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <exception>
#include <limits>
#include <utility>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "client/cli/exit_code.h"
#include "client/cli/gdal_edge.h"
#include "client/cli/geo_math.h"
#include "client/cli/raster_band.h"
#include "client/cli/raster_source.h"

namespace fathom::client::cli {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

// The sample that the sign is decided from: this many rows and columns.
constexpr int kSampleSide = 512;

class GdalDepthRaster final : public DepthRaster {
 public:
  GdalDepthRaster(DatasetPtr dataset, const RasterOptions& options)
      : dataset_(std::move(dataset)), options_(options) {}

  absl::Status Initialize() {
    summary_.driver = dataset_->GetDriver()->GetDescription();
    summary_.source_columns = dataset_->GetRasterXSize();
    summary_.source_rows = dataset_->GetRasterYSize();
    FATHOM_RETURN_IF_ERROR(ChooseBands());
    absl::StatusOr<RasterSource> source =
        RasterSource::Create(*dataset_, options_.crs, summary_.remarks);
    if (!source.ok()) return Named(source.status());
    source_ = std::make_unique<RasterSource>(*std::move(source));
    summary_.crs = source_->crs_name();
    const std::optional<LonLatGrid> clipped =
        Clip(source_->grid(), options_.clip);
    if (!clipped.has_value()) {
      return Named(absl::InvalidArgumentError(
          "no part of it lies inside the mission's area"));
    }
    grid_ = *clipped;
    land_has_zero_std_ = std_ && WrittenByUs();
    FATHOM_RETURN_IF_ERROR(DecidePositive());
    return absl::OkStatus();
  }

  const LonLatGrid& grid() const override { return grid_; }
  const RasterSummary& summary() const override { return summary_; }
  const RasterCounts& counts() const override { return counts_; }

  absl::StatusOr<v1::DepthTile> Read(const GridBlock& block) override {
    try {
      return ReadBlock(block);
    } catch (const std::exception& error) {
      return Named(absl::DataLossError(error.what()));
    }
  }

 private:
  absl::Status Named(const absl::Status& status) const {
    return FileError(absl::Status(
        status.code(), absl::StrFormat("%s: %s", options_.path,
                                       std::string(status.message()))));
  }

  absl::StatusOr<RasterBand> OpenBand(int number, double divisor) {
    absl::StatusOr<RasterBand> band =
        RasterBand::Open(*dataset_, number, divisor, summary_.remarks);
    if (!band.ok()) return Named(band.status());
    return band;
  }

  absl::StatusOr<BandCells> ReadBand(const RasterBand& band,
                                     const RasterWindow& window, int columns,
                                     int rows) const {
    absl::StatusOr<BandCells> cells =
        band.Read(window, columns, rows, kMaxPlausibleM);
    if (!cells.ok()) return Named(cells.status());
    return cells;
  }

  absl::Status ChooseBands() {
    int depth = options_.depth_band;
    int std = options_.std_band;
    for (int i = 1; i <= dataset_->GetRasterCount(); ++i) {
      const std::string description =
          dataset_->GetRasterBand(i)->GetDescription();
      if (depth == 0 &&
          ContainsWord(description, {"elevation", "depth", "bathy"})) {
        depth = i;
      }
      if (std == 0 && !options_.std_m.has_value() &&
          ContainsWord(description,
                       {"uncert", "std", "sigma", "standard dev"})) {
        std = i;
      }
    }
    if (depth == 0) depth = 1;
    FATHOM_ASSIGN_OR_RETURN(depth_, OpenBand(depth, 1));
    const std::string description = depth_.description();
    if (dataset_->GetRasterCount() > 1) {
      summary_.remarks.push_back(
          absl::StrFormat("depths from band %d%s", depth,
                          description.empty() ? "" : " (" + description + ")"));
    }
    if (std != 0) {
      FATHOM_ASSIGN_OR_RETURN(
          std_,
          OpenBand(std, options_.std_is_95_percent ? kSigmasOf95Percent : 1));
      const std::string name = std_.description();
      summary_.std_source = absl::StrFormat(
          "band %d%s, %s", std, name.empty() ? "" : " (" + name + ")",
          options_.std_is_95_percent
              ? "stated at 95 %: divided by 1.96"
              : absl::StrFormat("taken as one sigma (if it states 95 %%: "
                                "--std-95-band %d)",
                                std));
      if (options_.std_m.has_value()) {
        absl::StrAppendFormat(&summary_.std_source, "; else %g m",
                              *options_.std_m);
      }
    } else if (options_.std_m.has_value()) {
      summary_.std_source = absl::StrFormat("%g m everywhere", *options_.std_m);
    } else {
      return Named(absl::InvalidArgumentError(
          "it states no uncertainty: say how good the chart is with --std-m "
          "(1 sigma, metres), or name a band with --std-band"));
    }
    return absl::OkStatus();
  }

  // Looks at a sample of the values, or at all where the sample is empty.
  absl::Status DecidePositive() {
    const int columns = summary_.source_columns;
    const int rows = summary_.source_rows;
    FATHOM_RETURN_IF_ERROR(Sample({0, 0, columns, rows},
                                  std::min(columns, kSampleSide),
                                  std::min(rows, kSampleSide)));
    for (int row = 0; values_ == 0 && row < rows; row += kSampleSide) {
      const int height = std::min(kSampleSide, rows - row);
      FATHOM_RETURN_IF_ERROR(
          Sample({0, row, columns, height}, columns, height));
    }
    if (values_ == 0) {
      return Named(absl::InvalidArgumentError(
          "every cell is nodata: there is nothing to import"));
    }
    if (options_.positive != Positive::kAuto) {
      summary_.positive = options_.positive;
      summary_.positive_reason = "as stated by --positive";
      return absl::OkStatus();
    }
    SignEvidence evidence;
    evidence.driver = summary_.driver;
    evidence.band_description = depth_.description();
    evidence.file_name = options_.path;
    evidence.values = values_;
    evidence.negative_values = negative_values_;
    for (char** items :
         {depth_.gdal().GetMetadata(), dataset_->GetMetadata()}) {
      for (int i = 0; items != nullptr && items[i] != nullptr; ++i) {
        const std::string item = items[i];
        const std::size_t equal = item.find('=');
        if (equal == std::string::npos) continue;
        evidence.metadata.emplace_back(item.substr(0, equal),
                                       item.substr(equal + 1));
      }
    }
    absl::StatusOr<SignDecision> decision = DecideSign(evidence);
    if (!decision.ok()) return FileError(decision.status());
    summary_.positive = decision->positive;
    summary_.positive_reason = decision->reason;
    return absl::OkStatus();
  }

  absl::Status Sample(const RasterWindow& window, int columns, int rows) {
    FATHOM_ASSIGN_OR_RETURN(const BandCells cells,
                            ReadBand(depth_, window, columns, rows));
    for (const float value : cells.values) {
      values_ += std::isfinite(value);
      negative_values_ += value < 0;
    }
    return absl::OkStatus();
  }

  absl::StatusOr<v1::DepthTile> ReadBlock(const GridBlock& block) {
    const std::size_t cells =
        static_cast<std::size_t>(block.rows * block.columns);
    std::vector<double> x(cells), y(cells);
    std::size_t i = 0;
    for (std::int64_t row = 0; row < block.rows; ++row) {
      for (std::int64_t column = 0; column < block.columns; ++column, ++i) {
        x[i] = grid_.CenterLongitude(block.first_column + column);
        y[i] = grid_.CenterLatitude(block.first_row + row);
      }
    }
    source_->ToPixels(x, y);

    // The part of the source that this block looks at.
    double low_x = summary_.source_columns, high_x = -1;
    double low_y = summary_.source_rows, high_y = -1;
    for (i = 0; i < cells; ++i) {
      if (!Inside(x[i], y[i])) continue;
      low_x = std::min(low_x, x[i]);
      high_x = std::max(high_x, x[i]);
      low_y = std::min(low_y, y[i]);
      high_y = std::max(high_y, y[i]);
    }
    BandCells depths, stds;
    RasterWindow window;
    if (high_x >= low_x) {
      window = {static_cast<int>(low_x), static_cast<int>(low_y),
                static_cast<int>(high_x) - static_cast<int>(low_x) + 1,
                static_cast<int>(high_y) - static_cast<int>(low_y) + 1};
      FATHOM_ASSIGN_OR_RETURN(
          depths, ReadBand(depth_, window, window.columns, window.rows));
      if (std_) {
        FATHOM_ASSIGN_OR_RETURN(
            stds, ReadBand(std_, window, window.columns, window.rows));
      }
    }
    v1::DepthTile tile = EmptyTile(block);
    if (!std_) {
      tile.add_std_m(static_cast<float>(*options_.std_m));
    }
    std::string land(cells, '\0');
    bool any_land = false;
    for (i = 0; i < cells; ++i) {
      float depth = kNan;
      float std = options_.std_m.has_value()
                      ? static_cast<float>(*options_.std_m)
                      : kNan;
      bool marked_land = false;
      if (Inside(x[i], y[i])) {
        const std::size_t at =
            static_cast<std::size_t>(static_cast<int>(y[i]) - window.row) *
                static_cast<std::size_t>(window.columns) +
            static_cast<std::size_t>(static_cast<int>(x[i]) - window.column);
        depth = summary_.positive == Positive::kUp ? -depths.values[at]
                                                   : depths.values[at];
        if (std_ && stds.values[at] > 0) std = stds.values[at];
        counts_.implausible += depths.implausible[at];
        marked_land =
            land_has_zero_std_ && std::isnan(depth) && stds.values[at] == 0;
      }
      if (marked_land || -depth > options_.land_above_m) {
        land[i] = 1;
        any_land = true;
        depth = kNan;
        ++counts_.land;
      } else if (std::isfinite(depth) && !(std > 0)) {
        depth = kNan;
        ++counts_.without_std;
        ++counts_.unknown;
      } else if (std::isfinite(depth)) {
        ++counts_.with_depth;
      } else {
        ++counts_.unknown;
      }
      // A depth of -0.0 reads badly.
      tile.add_depth_m(depth == 0 ? 0.0f : depth);
      if (std_) {
        // The contract wants a number for cells without a depth too.
        tile.add_std_m(std::isfinite(depth) ? std : 1.0f);
      }
    }
    if (any_land) tile.set_land(std::move(land));
    return tile;
  }

  // Whether `fathom export` wrote it, which marks land by an uncertainty of 0
  // beside no depth (raster_writer.h).
  bool WrittenByUs() {
    if (dataset_->GetMetadataItem("FATHOM_LAND") != nullptr) return true;
    char** xml = dataset_->GetMetadata("xml:BAG");
    return xml != nullptr && xml[0] != nullptr &&
           std::strstr(xml[0], "Fathom obstacle map") != nullptr;
  }

  bool Inside(double x, double y) const {
    return x >= 0 && y >= 0 && x < summary_.source_columns &&
           y < summary_.source_rows;
  }

  v1::DepthTile EmptyTile(const GridBlock& block) const {
    v1::DepthTile tile;
    const double north_deg =
        grid_.north_deg -
        static_cast<double>(block.first_row) * grid_.latitude_step_deg;
    const double west_deg =
        grid_.west_deg +
        static_cast<double>(block.first_column) * grid_.longitude_step_deg;
    tile.mutable_north_west()->set_latitude_deg(std::min(90.0, north_deg));
    tile.mutable_north_west()->set_longitude_deg(WrapLongitude(west_deg));
    tile.set_latitude_step_deg(grid_.latitude_step_deg);
    tile.set_longitude_step_deg(grid_.longitude_step_deg);
    tile.set_rows(static_cast<std::uint32_t>(block.rows));
    tile.set_columns(static_cast<std::uint32_t>(block.columns));
    tile.mutable_depth_m()->Reserve(static_cast<int>(block.rows) *
                                    static_cast<int>(block.columns));
    return tile;
  }

  const DatasetPtr dataset_;
  const RasterOptions options_;
  RasterSummary summary_;
  RasterCounts counts_;
  RasterBand depth_;
  RasterBand std_;  // None: options_.std_m for all.
  bool land_has_zero_std_ = false;
  std::unique_ptr<RasterSource> source_;
  LonLatGrid grid_;
  std::uint64_t values_ = 0;
  std::uint64_t negative_values_ = 0;
};

DatasetPtr OpenDataset(const std::string& path,
                       const char* const* open_options = nullptr) {
  return DatasetPtr(GDALDataset::Open(
      path.c_str(), GDAL_OF_RASTER | GDAL_OF_READONLY | GDAL_OF_VERBOSE_ERROR,
      nullptr, open_options, nullptr));
}

absl::Status NotReadable(const std::string& path, const GdalErrors& errors) {
  return FileError(absl::NotFoundError(absl::StrFormat(
      "%s: not a raster that GDAL can open (%s)", path, errors.message())));
}

// A container without a band of its own: which one is meant?
absl::Status ManyInside(const std::string& path, GDALDataset& dataset) {
  std::string names;
  char** items = dataset.GetMetadata("SUBDATASETS");
  for (int i = 0; items != nullptr && items[i] != nullptr; ++i) {
    const std::string item = items[i];
    const std::size_t at = item.find("_NAME=");
    if (at != std::string::npos) names += "\n  " + item.substr(at + 6);
  }
  if (names.empty()) {
    return FileError(absl::InvalidArgumentError(path + ": holds no raster"));
  }
  return FileError(absl::InvalidArgumentError(
      path + ": holds several rasters; name one of them instead:" + names));
}

}  // namespace

absl::StatusOr<std::unique_ptr<DepthRaster>> DepthRaster::Open(
    const RasterOptions& options) {
  if (options.std_m.has_value() &&
      !(*options.std_m > 0 && std::isfinite(*options.std_m))) {
    return UsageError(absl::InvalidArgumentError(
        absl::StrFormat("std_m=%g: must be above 0", *options.std_m)));
  }
  try {
    GDALAllRegister();
    const GdalErrors errors;
    DatasetPtr dataset = OpenDataset(options.path);
    if (dataset == nullptr) return NotReadable(options.path, errors);
    if (dataset->GetRasterCount() == 0) {
      return ManyInside(options.path, *dataset);
    }
    bool variable_resolution = false;
    if (const char* has = dataset->GetMetadataItem("HAS_SUPERGRIDS")) {
      variable_resolution = std::strcmp(has, "TRUE") == 0;
    }
    if (variable_resolution) {
      // The plain grid of a variable-resolution BAG is an overview that hides
      // rocks: take the finest grid, and in it the shoalest of each cell.
      const char* const kFinest[] = {"MODE=RESAMPLED_GRID", "RES_STRATEGY=MIN",
                                     "VALUE_POPULATION=MAX", nullptr};
      dataset = OpenDataset(options.path, kFinest);
      if (dataset == nullptr) return NotReadable(options.path, errors);
    }
    auto raster =
        std::make_unique<GdalDepthRaster>(std::move(dataset), options);
    FATHOM_RETURN_IF_ERROR(raster->Initialize());
    return raster;
  } catch (const std::exception& error) {
    return FileError(absl::DataLossError(
        absl::StrFormat("%s: %s", options.path, error.what())));
  }
}

}  // namespace fathom::client::cli
