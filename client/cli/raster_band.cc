#include "client/cli/raster_band.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <limits>

#include "absl/strings/str_format.h"

namespace fathom::client::cli {
namespace {

// Values that stand for "nothing" in files that do not declare it.
constexpr std::array<double, 6> kSentinels = {-9999,   9999,   -32'768,
                                              -99'999, 99'999, 1'000'000};

double MetersPerUnit(const std::string& unit) {
  if (ContainsWord(unit, {"fathom"})) return 1.8288;
  if (unit == "ft" || ContainsWord(unit, {"foot", "feet"})) return 0.3048;
  if (unit == "cm") return 0.01;
  if (unit == "km") return 1000;
  return 1;
}

}  // namespace

bool ContainsWord(std::string text, std::initializer_list<const char*> words) {
  for (char& c : text) c = static_cast<char>(std::tolower(c));
  return std::any_of(words.begin(), words.end(), [&](const char* word) {
    return text.find(word) != std::string::npos;
  });
}

absl::StatusOr<RasterBand> RasterBand::Open(GDALDataset& dataset, int number,
                                            double divisor,
                                            std::vector<std::string>& remarks) {
  if (number < 1 || number > dataset.GetRasterCount()) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "band=%d: it has bands 1 to %d", number, dataset.GetRasterCount()));
  }
  RasterBand band;
  band.band_ = dataset.GetRasterBand(number);
  if (GDALDataTypeIsComplex(band.band_->GetRasterDataType())) {
    return absl::InvalidArgumentError(
        absl::StrFormat("band=%d: holds complex numbers", number));
  }
  int has = 0;
  const double scale = band.band_->GetScale(&has);
  if (has && std::isfinite(scale) && scale != 0) band.scale_ = scale;
  const double offset = band.band_->GetOffset(&has);
  if (has && std::isfinite(offset)) band.offset_ = offset;
  band.band_->GetNoDataValue(&has);
  band.declares_nodata_ = has || band.band_->GetMaskFlags() != GMF_ALL_VALID;
  const char* unit = band.band_->GetUnitType();
  const double meters = MetersPerUnit(unit == nullptr ? "" : unit);
  if (meters != 1) {
    remarks.push_back(
        absl::StrFormat("band %d is in %s: turned into metres", number, unit));
  }
  band.scale_ *= meters / divisor;
  band.offset_ *= meters / divisor;
  return band;
}

bool RasterBand::Empty(const RasterWindow& window) const {
  const GdalErrors errors;
  double percent = 0;
  const int status = band_->GetDataCoverageStatus(
      window.column, window.row, window.columns, window.rows, 0, &percent);
  return (status & GDAL_DATA_COVERAGE_STATUS_UNIMPLEMENTED) == 0 &&
         (status & GDAL_DATA_COVERAGE_STATUS_EMPTY) != 0 &&
         (status & GDAL_DATA_COVERAGE_STATUS_DATA) == 0 && declares_nodata_;
}

absl::StatusOr<BandCells> RasterBand::Read(const RasterWindow& window,
                                           int columns, int rows,
                                           double limit_m) const {
  const GdalErrors errors;
  const std::size_t count =
      static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows);
  std::vector<double> raw(count);
  std::vector<std::uint8_t> mask;
  CPLErr result = band_->RasterIO(GF_Read, window.column, window.row,
                                  window.columns, window.rows, raw.data(),
                                  columns, rows, GDT_Float64, 0, 0, nullptr);
  if (result == CE_None && band_->GetMaskFlags() != GMF_ALL_VALID) {
    mask.resize(count);
    result = band_->GetMaskBand()->RasterIO(
        GF_Read, window.column, window.row, window.columns, window.rows,
        mask.data(), columns, rows, GDT_Byte, 0, 0, nullptr);
  }
  if (result != CE_None) {
    return absl::DataLossError(absl::StrFormat(
        "damaged or cut off: rows %d to %d cannot be read (%s)", window.row,
        window.row + window.rows - 1, errors.message()));
  }
  BandCells cells;
  cells.values.resize(count);
  cells.implausible.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    const double value = raw[i] * scale_ + offset_;
    const bool masked = !mask.empty() && mask[i] == 0;
    const bool sentinel =
        !declares_nodata_ && std::find(kSentinels.begin(), kSentinels.end(),
                                       raw[i]) != kSentinels.end();
    const bool beyond = !(std::abs(value) <= limit_m);  // Or NaN.
    cells.implausible[i] =
        !masked && std::isfinite(raw[i]) && (sentinel || beyond);
    cells.values[i] = masked || sentinel || beyond
                          ? std::numeric_limits<float>::quiet_NaN()
                          : static_cast<float>(value);
  }
  return cells;
}

}  // namespace fathom::client::cli
