#include "client/cli/raster.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <limits>
#include <optional>
#include <utility>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "client/cli/bag_metadata.h"
#include "client/cli/exit_code.h"
#include "client/cli/gdal_edge.h"
#include "client/cli/geo_math.h"
#include "client/cli/raster_band.h"
#include "client/cli/raster_open.h"
#include "client/cli/raster_source.h"

namespace fathom::client::cli {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

// The sample that the sign is decided from: this many rows and columns; of
// large rasters fewer, since each sampled cell may cost decoding a tile.
constexpr int kSampleSide = 512;
constexpr int kLargeSampleSide = 64;
constexpr double kLargeRasterCells = 1e8;

// Source cells read for each one wanted before a block is read in halves, and
// the size below which that is not worth it.
constexpr double kMostSpread = 8;
constexpr double kSmallWindow = 65'536;

class GdalDepthRaster final : public DepthRaster {
 public:
  // `summary` holds the remarks made on opening.
  GdalDepthRaster(DatasetPtr dataset, const RasterOptions& options,
                  RasterSummary summary)
      : dataset_(std::move(dataset)),
        options_(options),
        summary_(std::move(summary)) {}

  absl::Status Initialize() {
    summary_.driver = dataset_->GetDriver()->GetDescription();
    if (summary_.driver == "MEM") summary_.driver = "topotype";
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

  std::vector<std::string> files() const override {
    std::vector<std::string> names;
    char** list = dataset_->GetFileList();
    for (int i = 0; list != nullptr && list[i] != nullptr; ++i) {
      names.emplace_back(list[i]);
    }
    CSLDestroy(list);
    // Read into memory: it has none of its own.
    if (names.empty()) names.push_back(options_.path);
    return names;
  }

  absl::StatusOr<v1::DepthTile> Read(const GridBlock& block) override {
    const GdalErrors quiet;
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
      const StdMeaning meaning = MeaningOfStd(std);
      FATHOM_ASSIGN_OR_RETURN(
          std_, OpenBand(std, meaning.is_95_percent ? kSigmasOf95Percent : 1));
      const std::string name = std_.description();
      summary_.std_source =
          absl::StrFormat("band %d%s, %s", std,
                          name.empty() ? "" : " (" + name + ")", meaning.text);
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

  struct StdMeaning {
    bool is_95_percent = false;
    std::string text;
  };

  // What the values of the std band are: as the caller says, as a BAG says,
  // else one sigma is assumed.
  StdMeaning MeaningOfStd(int band) {
    if (options_.std_is_95_percent) {
      return {true, "stated at 95 %: divided by 1.96"};
    }
    if (options_.std_band != 0) return {false, "one sigma, as stated"};
    if (summary_.driver == "BAG") {
      const BagUncertainty bag = ReadBagUncertainty(BagXml(*dataset_));
      if (bag.is_95_percent) {
        return {true,
                absl::StrFormat("which the BAG calls \"%s\", 95 %%: divided by "
                                "1.96 (if it is one sigma: --std-band %d)",
                                bag.code, band)};
      }
      if (bag.stated) {
        return {false, absl::StrFormat("which the BAG calls \"%s\": one sigma",
                                       bag.code)};
      }
      return {false,
              absl::StrFormat("whose meaning the BAG does not say (\"%s\"): "
                              "taken as one sigma (if it states 95 %%: "
                              "--std-95-band %d)",
                              bag.code, band)};
    }
    return {false, absl::StrFormat("taken as one sigma (if it states 95 %%: "
                                   "--std-95-band %d)",
                                   band)};
  }

  // Looks at a sample of the values, or at all where the sample is empty.
  absl::Status DecidePositive() {
    const RasterWindow window =
        WindowUnder({0, 0, grid_.rows, grid_.columns})
            .value_or(RasterWindow{0, 0, summary_.source_columns,
                                   summary_.source_rows});
    if (window.columns > 0 && window.rows > 0) {
      const bool large =
          static_cast<double>(window.columns) * window.rows > kLargeRasterCells;
      const int side = large ? kLargeSampleSide : kSampleSide;
      FATHOM_RETURN_IF_ERROR(Sample(window, std::min(window.columns, side),
                                    std::min(window.rows, side)));
      FATHOM_RETURN_IF_ERROR(SampleUntilFound(window));
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
    return CheckNotAllLand();
  }

  // A chart of land alone is more likely one with its sign turned.
  absl::Status CheckNotAllLand() const {
    const bool up = summary_.positive == Positive::kUp;
    if ((up ? lowest_ : -highest_) <= options_.land_above_m) {
      return absl::OkStatus();
    }
    return Named(absl::InvalidArgumentError(absl::StrFormat(
        "taken as %s (%s), all of its values, %g to %g m, are land: if they "
        "are %s, say --positive %s; if it is land, say --positive %s",
        up ? "elevations" : "depths", summary_.positive_reason, lowest_,
        highest_, up ? "depths" : "elevations", up ? "down" : "up",
        up ? "up" : "down")));
  }

  // Tile by tile, while nothing was found.
  absl::Status SampleUntilFound(const RasterWindow& window) {
    const int last_row = window.row + window.rows;
    const int last_column = window.column + window.columns;
    for (int row = window.row; row < last_row; row += kSampleSide) {
      for (int column = window.column; column < last_column;
           column += kSampleSide) {
        if (values_ > 0) return absl::OkStatus();
        const RasterWindow part{column, row,
                                std::min(kSampleSide, last_column - column),
                                std::min(kSampleSide, last_row - row)};
        if (depth_.Empty(part)) continue;
        FATHOM_RETURN_IF_ERROR(Sample(part, part.columns, part.rows));
      }
    }
    return absl::OkStatus();
  }

  absl::Status Sample(const RasterWindow& window, int columns, int rows) {
    FATHOM_ASSIGN_OR_RETURN(const BandCells cells,
                            ReadBand(depth_, window, columns, rows));
    for (const float value : cells.values) {
      if (!std::isfinite(value)) continue;
      ++values_;
      negative_values_ += value < 0;
      lowest_ = std::min(lowest_, value);
      highest_ = std::max(highest_, value);
    }
    return absl::OkStatus();
  }

  // The source's cells under a block, found from a lattice of places in it
  // and widened by what may bulge between them; of no columns where it lies
  // outside; nullopt where that cannot be told.
  std::optional<RasterWindow> WindowUnder(const GridBlock& block) const {
    constexpr int kSteps = 8;
    std::vector<double> x, y;
    for (int i = 0; i <= kSteps; ++i) {
      for (int j = 0; j <= kSteps; ++j) {
        const auto share = [](std::int64_t count, int step) {
          return count * step / kSteps;
        };
        x.push_back(grid_.CenterLongitude(block.first_column +
                                          share(block.columns - 1, j)));
        y.push_back(
            grid_.CenterLatitude(block.first_row + share(block.rows - 1, i)));
      }
    }
    source_->ToPixels(x, y);
    double low_x = x[0], high_x = x[0], low_y = y[0], high_y = y[0];
    for (std::size_t i = 0; i < x.size(); ++i) {
      if (!std::isfinite(x[i]) || !std::isfinite(y[i])) return std::nullopt;
      low_x = std::min(low_x, x[i]);
      high_x = std::max(high_x, x[i]);
      low_y = std::min(low_y, y[i]);
      high_y = std::max(high_y, y[i]);
    }
    const double bulge_x = 2 + (high_x - low_x) / kSteps;
    const double bulge_y = 2 + (high_y - low_y) / kSteps;
    const auto cell = [](double place, int end) {
      return static_cast<int>(std::clamp(place, 0.0, static_cast<double>(end)));
    };
    RasterWindow window;
    window.column = cell(low_x - bulge_x, summary_.source_columns);
    window.row = cell(low_y - bulge_y, summary_.source_rows);
    window.columns =
        cell(high_x + bulge_x + 1, summary_.source_columns) - window.column;
    window.rows = cell(high_y + bulge_y + 1, summary_.source_rows) - window.row;
    return window;
  }

  // What stands in the source at each cell of a block.
  struct BlockCells {
    std::vector<float> value;  // NaN: none.
    std::vector<float> std;    // NaN: none. Empty without a std band.
    std::vector<std::uint8_t> implausible;
  };

  // Fills the cells `indices`, which lie at `x`, `y` inside the source. Where
  // they are spread wide over the source (a block across the file's own seam of
  // longitude), they are read in halves, so that memory stays bounded.
  absl::Status ReadCells(const std::vector<double>& x,
                         const std::vector<double>& y,
                         const std::vector<std::size_t>& indices,
                         BlockCells& cells) const {
    double low_x = summary_.source_columns, high_x = -1;
    double low_y = summary_.source_rows, high_y = -1;
    for (const std::size_t i : indices) {
      low_x = std::min(low_x, x[i]);
      high_x = std::max(high_x, x[i]);
      low_y = std::min(low_y, y[i]);
      high_y = std::max(high_y, y[i]);
    }
    if (indices.empty()) return absl::OkStatus();
    const RasterWindow window = {
        static_cast<int>(low_x), static_cast<int>(low_y),
        static_cast<int>(high_x) - static_cast<int>(low_x) + 1,
        static_cast<int>(high_y) - static_cast<int>(low_y) + 1};
    const double spread = static_cast<double>(window.columns) * window.rows;
    if (spread > kMostSpread * static_cast<double>(indices.size()) &&
        spread > kSmallWindow) {
      const bool by_x = window.columns > window.rows;
      const double middle = by_x ? (low_x + high_x) / 2 : (low_y + high_y) / 2;
      std::vector<std::size_t> low, high;
      for (const std::size_t i : indices) {
        ((by_x ? x[i] : y[i]) < middle ? low : high).push_back(i);
      }
      FATHOM_RETURN_IF_ERROR(ReadCells(x, y, low, cells));
      return ReadCells(x, y, high, cells);
    }
    FATHOM_ASSIGN_OR_RETURN(
        const BandCells depths,
        ReadBand(depth_, window, window.columns, window.rows));
    BandCells stds;
    if (std_) {
      FATHOM_ASSIGN_OR_RETURN(
          stds, ReadBand(std_, window, window.columns, window.rows));
    }
    for (const std::size_t i : indices) {
      const std::size_t at =
          static_cast<std::size_t>(static_cast<int>(y[i]) - window.row) *
              static_cast<std::size_t>(window.columns) +
          static_cast<std::size_t>(static_cast<int>(x[i]) - window.column);
      cells.value[i] = depths.values[at];
      cells.implausible[i] = depths.implausible[at];
      if (std_) cells.std[i] = stds.values[at];
    }
    return absl::OkStatus();
  }

  // No cells at all where the file stores nothing under the block.
  absl::StatusOr<BlockCells> ReadSource(const GridBlock& block) const {
    const auto count = static_cast<std::size_t>(block.rows * block.columns);
    if (const auto window = WindowUnder(block);
        window.has_value() &&
        (window->columns <= 0 || window->rows <= 0 || depth_.Empty(*window))) {
      return BlockCells();
    }
    BlockCells cells;
    cells.value.assign(count, kNan);
    cells.implausible.assign(count, 0);
    if (std_) cells.std.assign(count, kNan);
    std::vector<double> x(count), y(count);
    std::size_t i = 0;
    for (std::int64_t row = 0; row < block.rows; ++row) {
      for (std::int64_t column = 0; column < block.columns; ++column, ++i) {
        x[i] = grid_.CenterLongitude(block.first_column + column);
        y[i] = grid_.CenterLatitude(block.first_row + row);
      }
    }
    source_->ToPixels(x, y);
    std::vector<std::size_t> inside;
    inside.reserve(count);
    for (i = 0; i < count; ++i) {
      if (Inside(x[i], y[i])) inside.push_back(i);
    }
    FATHOM_RETURN_IF_ERROR(ReadCells(x, y, inside, cells));
    return cells;
  }

  absl::StatusOr<v1::DepthTile> ReadBlock(const GridBlock& block) {
    FATHOM_ASSIGN_OR_RETURN(const BlockCells cells, ReadSource(block));
    v1::DepthTile tile = EmptyTile(block);
    if (cells.value.empty()) {
      counts_.unknown += static_cast<std::uint64_t>(block.rows * block.columns);
      return tile;
    }
    tile.mutable_depth_m()->Reserve(
        static_cast<int>(block.rows * block.columns));
    if (!std_) tile.add_std_m(static_cast<float>(*options_.std_m));
    const float std_elsewhere =
        options_.std_m.has_value() ? static_cast<float>(*options_.std_m) : kNan;
    const bool up = summary_.positive == Positive::kUp;
    std::string land(cells.value.size(), '\0');
    bool any_land = false;
    for (std::size_t i = 0; i < cells.value.size(); ++i) {
      float depth = up ? -cells.value[i] : cells.value[i];
      float std = std_elsewhere;
      if (std_ && cells.std[i] > 0) std = cells.std[i];
      counts_.implausible += cells.implausible[i];
      const bool marked_land =
          land_has_zero_std_ && std::isnan(depth) && cells.std[i] == 0;
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
    return dataset_->GetMetadataItem("FATHOM_LAND") != nullptr ||
           BagXml(*dataset_).find("Fathom obstacle map") != std::string::npos;
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
  float lowest_ = std::numeric_limits<float>::infinity();
  float highest_ = -std::numeric_limits<float>::infinity();
};

}  // namespace

absl::StatusOr<std::unique_ptr<DepthRaster>> DepthRaster::Open(
    const RasterOptions& options) {
  if (options.std_m.has_value() &&
      !(*options.std_m > 0 && std::isfinite(*options.std_m))) {
    return UsageError(absl::InvalidArgumentError(
        absl::StrFormat("std_m=%g: must be above 0", *options.std_m)));
  }
  const GdalErrors quiet;
  try {
    RasterSummary summary;
    FATHOM_ASSIGN_OR_RETURN(DatasetPtr dataset,
                            OpenChart(options, summary.remarks));
    auto raster = std::make_unique<GdalDepthRaster>(std::move(dataset), options,
                                                    std::move(summary));
    FATHOM_RETURN_IF_ERROR(raster->Initialize());
    return raster;
  } catch (const std::exception& error) {
    return FileError(absl::DataLossError(
        absl::StrFormat("%s: %s", options.path, error.what())));
  }
}

}  // namespace fathom::client::cli
