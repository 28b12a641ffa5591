#include "client/cli/raster_source.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "client/cli/bag_metadata.h"
#include "client/cli/geo_math.h"
#include "client/cli/raster_open.h"

namespace fathom::client::cli {
namespace {

// A turn that misses 360 degrees by less than this share of a cell a column
// was rounded when written (ETOPO5's 32-bit longitudes).
constexpr double kTurnSlackCells = 0.5;

// A datum that moves its cells by less than this leaves them where they are.
constexpr double kDatumSlackCells = 0.01;

// The steps are a little smaller than they must be: between the samples the
// projection bends.
constexpr double kCurvatureShare = 0.999;

// Beyond it longitudes run together.
constexpr double kMaxPlaneLatitudeDeg = 89;

// Places along each side whose coordinates bound a projected raster.
constexpr int kOutlineSteps = 32;

// netCDF says the axes' units when it knows no reference system.
bool AxesAreDegrees(GDALDataset& dataset) {
  bool east = false;
  bool north = false;
  char** items = dataset.GetMetadata();
  for (int i = 0; items != nullptr && items[i] != nullptr; ++i) {
    const std::string item = items[i];
    east = east || item.find("#units=degrees_east") != std::string::npos;
    north = north || item.find("#units=degrees_north") != std::string::npos;
  }
  return east && north;
}

double NearestTurn(double longitude_deg, double reference_deg) {
  return reference_deg + WrapLongitude(longitude_deg - reference_deg);
}

}  // namespace

absl::StatusOr<RasterSource> RasterSource::Create(
    GDALDataset& dataset, const std::string& crs,
    std::vector<std::string>& remarks) {
  RasterSource source;
  source.columns_ = dataset.GetRasterXSize();
  source.rows_ = dataset.GetRasterYSize();
  if (dataset.GetGeoTransform(source.to_map_.data()) != CE_None ||
      !GDALInvGeoTransform(source.to_map_.data(), source.to_pixel_.data())) {
    return absl::InvalidArgumentError(
        "the raster does not say where its cells lie (no geotransform)");
  }
  FATHOM_RETURN_IF_ERROR(source.ReadReference(dataset, crs, remarks));
  FATHOM_RETURN_IF_ERROR(source.PlanGrid());
  return source;
}

absl::Status RasterSource::ReadReference(GDALDataset& dataset,
                                         const std::string& crs,
                                         std::vector<std::string>& remarks) {
  if (!crs.empty()) {
    if (reference_.SetFromUserInput(crs.c_str()) != OGRERR_NONE) {
      return absl::InvalidArgumentError(absl::StrFormat(
          "crs=\"%s\": not a coordinate reference system; say for example "
          "EPSG:32619",
          crs));
    }
  } else if (const OGRSpatialReference* own = dataset.GetSpatialRef();
             own != nullptr && !own->IsEmpty() && !own->IsLocal()) {
    reference_ = *own;
  } else if (const auto epsg = ReadBagEpsg(BagXml(dataset));
             epsg.has_value() &&
             reference_.importFromEPSG(*epsg) == OGRERR_NONE) {
    remarks.push_back(absl::StrFormat(
        "coordinate reference system by number, EPSG:%d", *epsg));
  } else if (AxesAreDegrees(dataset)) {
    reference_.importFromEPSG(4326);
    remarks.emplace_back(
        "no coordinate reference system, but axes in degrees_east and "
        "degrees_north: taken as WGS 84");
  } else {
    return absl::InvalidArgumentError(
        "no coordinate reference system: say which one with --crs, for "
        "example --crs EPSG:4326 (degrees) or --crs EPSG:32619 (UTM 19 N)");
  }
  // Depths stay on the file's vertical datum; only places are transformed.
  reference_.StripVertical();
  reference_.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
  geographic_ = reference_.IsGeographic();
  if (const char* name = reference_.GetName()) crs_name_ = name;

  OGRSpatialReference wgs84;
  wgs84.importFromEPSG(4326);
  wgs84.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
  if (geographic_ && reference_.IsSame(&wgs84)) return absl::OkStatus();
  from_wgs84_.reset(OGRCreateCoordinateTransformation(&wgs84, &reference_));
  to_wgs84_.reset(OGRCreateCoordinateTransformation(&reference_, &wgs84));
  if (from_wgs84_ == nullptr || to_wgs84_ == nullptr) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "no way from its coordinate reference system \"%s\" to WGS 84: state "
        "another one with --crs",
        crs_name_));
  }
  return absl::OkStatus();
}

absl::StatusOr<bool> RasterSource::KeepOwnGrid() {
  if (!geographic_ || to_map_[2] != 0 || to_map_[4] != 0) return false;
  const double north = to_map_[3] + (to_map_[5] > 0 ? to_map_[5] * rows_ : 0);
  const double south = north - std::abs(to_map_[5]) * rows_;
  if (south < -91 || north > 91) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "its latitudes reach from %g to %g degrees: these are no degrees; "
        "state the coordinate reference system with --crs",
        south, north));
  }
  if (from_wgs84_ != nullptr) {
    // Another datum: its cells are its own only if they stay where they are.
    std::vector<double> x = {columns_ * 0.5};
    std::vector<double> y = {rows_ * 0.5};
    FromPixels(x, y);
    ToPixels(x, y);
    if (!(std::hypot(x[0] - columns_ * 0.5, y[0] - rows_ * 0.5) <
          kDatumSlackCells)) {
      return false;
    }
  }
  double step = std::abs(to_map_[1]);
  const double turn_error = step * columns_ - 360;
  grid_.periodic = std::abs(turn_error) < kTurnSlackCells * step;
  if (grid_.periodic && to_map_[1] > 0) {
    step = 360.0 / columns_;
    to_map_[1] = step;
    if (!GDALInvGeoTransform(to_map_.data(), to_pixel_.data())) {
      return absl::InvalidArgumentError("its cells have no size");
    }
  }
  grid_.longitude_step_deg = step;
  grid_.latitude_step_deg = std::abs(to_map_[5]);
  grid_.west_deg = to_map_[0] + (to_map_[1] < 0 ? to_map_[1] * columns_ : 0);
  grid_.north_deg = north;
  grid_.columns = columns_;
  grid_.rows = rows_;
  return true;
}

void RasterSource::FromPixels(std::vector<double>& x,
                              std::vector<double>& y) const {
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double column = x[i];
    const double row = y[i];
    x[i] = to_map_[0] + column * to_map_[1] + row * to_map_[2];
    y[i] = to_map_[3] + column * to_map_[4] + row * to_map_[5];
  }
  if (to_wgs84_ == nullptr) return;
  std::vector<int> known(x.size());
  to_wgs84_->Transform(static_cast<int>(x.size()), x.data(), y.data(), nullptr,
                       known.data());
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (!known[i] || !std::isfinite(x[i]) || !std::isfinite(y[i])) {
      x[i] = y[i] = std::numeric_limits<double>::quiet_NaN();
    }
  }
}

bool RasterSource::HoldsPole(int sign) const {
  if (geographic_) return false;
  std::vector<double> x = {0};
  std::vector<double> y = {90.0 * sign};
  ToPixels(x, y);
  return x[0] > 0 && x[0] < columns_ && y[0] > 0 && y[0] < rows_;
}

absl::Status RasterSource::PlanGrid() {
  FATHOM_ASSIGN_OR_RETURN(const bool own, KeepOwnGrid());
  if (own) return absl::OkStatus();

  // Three places a sample: a corner of a cell and its two neighbours.
  std::vector<double> x, y;
  for (int i = 0; i <= kOutlineSteps; ++i) {
    for (int j = 0; j <= kOutlineSteps; ++j) {
      const double column = columns_ * (static_cast<double>(i) / kOutlineSteps);
      const double row = rows_ * (static_cast<double>(j) / kOutlineSteps);
      const double right = i < kOutlineSteps ? 1 : -1;
      const double down = j < kOutlineSteps ? 1 : -1;
      x.insert(x.end(), {column, column + right, column});
      y.insert(y.end(), {row, row, row + down});
    }
  }
  FromPixels(x, y);
  if (std::any_of(x.begin(), x.end(), [](double v) { return std::isnan(v); })) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "parts of it lie outside its coordinate reference system \"%s\": the "
        "file's system or its corner is wrong",
        crs_name_));
  }
  const double middle_deg = x[x.size() / 6 * 3];
  double west = middle_deg, east = middle_deg, south = y[0], north = y[0];
  for (std::size_t i = 0; i < x.size(); i += 3) {
    const double longitude = NearestTurn(x[i], middle_deg);
    west = std::min(west, longitude);
    east = std::max(east, longitude);
    south = std::min(south, y[i]);
    north = std::max(north, y[i]);
  }
  for (const int sign : {1, -1}) {
    if (!HoldsPole(sign)) continue;
    west = -180;
    east = 180;
    (sign > 0 ? north : south) = 90.0 * sign;
    grid_.periodic = true;
  }
  const MetersPerDegree scale = MetersPerDegreeAt((south + north) / 2);
  double step_x = std::hypot(to_map_[1], to_map_[4]);
  double step_y = std::hypot(to_map_[2], to_map_[5]);
  if (!geographic_) {
    const double meters_per_unit = reference_.GetLinearUnits();
    step_x *= meters_per_unit / scale.longitude;
    step_y *= meters_per_unit / scale.latitude;
  }
  double k = 1;
  for (std::size_t i = 0; i < x.size(); i += 3) {
    // Near a pole a step crosses many meridians: no plane there.
    if (std::abs(y[i]) > kMaxPlaneLatitudeDeg) continue;
    // Columns a, b: one pixel right, one line down, in degrees.
    const double a_x = NearestTurn(x[i + 1], x[i]) - x[i];
    const double a_y = y[i + 1] - y[i];
    const double b_x = NearestTurn(x[i + 2], x[i]) - x[i];
    const double b_y = y[i + 2] - y[i];
    const double determinant = a_x * b_y - a_y * b_x;
    if (determinant == 0) continue;
    // A rectangle step_x by step_y times k fits into the parallelogram if its
    // corners, as multiples of a and of b, reach no farther than 1/2.
    const double of_a =
        (std::abs(b_y) * step_x + std::abs(b_x) * step_y) / determinant;
    const double of_b =
        (std::abs(a_y) * step_x + std::abs(a_x) * step_y) / determinant;
    k = std::min(k, kCurvatureShare / std::max(std::abs(of_a), std::abs(of_b)));
  }
  step_x *= k;
  step_y *= k;
  grid_.columns = static_cast<std::int64_t>(std::ceil((east - west) / step_x));
  grid_.rows = static_cast<std::int64_t>(std::ceil((north - south) / step_y));
  // A whole circle has whole cells.
  if (grid_.periodic) step_x = 360.0 / static_cast<double>(grid_.columns);
  grid_.north_deg = north;
  grid_.west_deg = west;
  grid_.longitude_step_deg = step_x;
  grid_.latitude_step_deg = step_y;
  return absl::OkStatus();
}

void RasterSource::ToPixels(std::vector<double>& x,
                            std::vector<double>& y) const {
  std::vector<int> known(x.size(), 1);
  if (from_wgs84_ != nullptr) {
    from_wgs84_->Transform(static_cast<int>(x.size()), x.data(), y.data(),
                           nullptr, known.data());
  }
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (!known[i]) {
      x[i] = y[i] = std::numeric_limits<double>::quiet_NaN();
      continue;
    }
    const auto pixel = [&](double map_x) {
      return to_pixel_[0] + map_x * to_pixel_[1] + y[i] * to_pixel_[2];
    };
    double map_x = x[i];
    if (geographic_) {
      // Onto the raster's own turn of longitude.
      while (pixel(map_x) < 0 && pixel(map_x + 360) < columns_ &&
             to_pixel_[1] > 0) {
        map_x += 360;
      }
      while (pixel(map_x) >= columns_ && pixel(map_x - 360) >= 0 &&
             to_pixel_[1] > 0) {
        map_x -= 360;
      }
    }
    const double line =
        to_pixel_[3] + map_x * to_pixel_[4] + y[i] * to_pixel_[5];
    x[i] = pixel(map_x);
    y[i] = line;
  }
}

}  // namespace fathom::client::cli
