#include "server/region.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "server/convert_common.h"
#include "server/errors.h"
#include "server/field_checks.h"
#include "server/limits.h"

namespace fathom::server {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr double kRadPerDeg = std::numbers::pi / 180;
constexpr double kEarthRadiusM = 6'400'000;  // The greatest, at a pole.

// Metres of one degree of latitude and of longitude: radii of curvature of
// the WGS 84 ellipsoid in the meridian and the prime vertical (Rapp 1991,
// "Geometric geodesy" part I, eqs. 3.87 and 3.99).
struct DegreeLengths {
  double latitude_m;
  double longitude_m;
};
DegreeLengths LengthsAt(double latitude_deg) {
  constexpr double kSemiMajorM = 6'378'137.0;
  constexpr double kFlattening = 1 / 298.257223563;
  constexpr double kEccentricity2 = kFlattening * (2 - kFlattening);
  const double sine = std::sin(latitude_deg * kRadPerDeg);
  const double w2 = 1 - kEccentricity2 * sine * sine;
  const double prime_m = kSemiMajorM / std::sqrt(w2);
  const double meridian_m = prime_m * (1 - kEccentricity2) / w2;
  return {.latitude_m = meridian_m * kRadPerDeg,
          .longitude_m =
              prime_m * std::cos(latitude_deg * kRadPerDeg) * kRadPerDeg};
}

double Wrap(double longitude_deg) {
  return longitude_deg > 180 ? longitude_deg - 360 : longitude_deg;
}

}  // namespace

absl::StatusOr<Region> Region::Create(const v1::GetRegionRequest& request,
                                      Time now, const FieldPath& root) {
  Region region;
  region.now_ = now;
  const FieldPath south_west_path(root, "south_west");
  const FieldPath north_east_path(root, "north_east");
  if (!request.has_south_west()) return Missing(south_west_path, "a corner");
  if (!request.has_north_east()) return Missing(north_east_path, "a corner");
  FATHOM_ASSIGN_OR_RETURN(const map::GeodeticPoint south_west,
                          CheckPoint(request.south_west(), south_west_path));
  FATHOM_ASSIGN_OR_RETURN(const map::GeodeticPoint north_east,
                          CheckPoint(request.north_east(), north_east_path));
  const double height_deg = north_east.latitude_deg - south_west.latitude_deg;
  if (height_deg <= 0) {
    return InvalidField(
        FieldPath(north_east_path, "latitude_deg").ToString(),
        absl::StrFormat("%g deg is not north of south_west.latitude_deg=%g",
                        north_east.latitude_deg, south_west.latitude_deg));
  }
  double width_deg = north_east.longitude_deg - south_west.longitude_deg;
  if (width_deg < 0) width_deg += 360;
  if (width_deg == 0) {
    return InvalidField(FieldPath(north_east_path, "longitude_deg").ToString(),
                        "equals south_west.longitude_deg: the area is empty");
  }
  FATHOM_RETURN_IF_ERROR(
      CheckNumber(request.resolution_m(),
                  {.min = kMinResolutionM, .max = kMaxResolutionM, .unit = "m"},
                  FieldPath(root, "resolution_m")));
  if (!request.activity_id().empty()) {
    FATHOM_RETURN_IF_ERROR(
        CheckId(request.activity_id(), FieldPath(root, "activity_id")));
    region.activity_id_.value = request.activity_id();
  }
  switch (request.layer()) {
    case v1::MAP_LAYER_UNSPECIFIED:
      break;
    case v1::MAP_LAYER_LOCAL:
      region.layers_ = map::LayerChoice::kLocalOnly;
      break;
    case v1::MAP_LAYER_GLOBAL:
      if (!region.activity_id_.empty()) {
        return InvalidField(FieldPath(root, "layer").ToString(),
                            "an activity_id is given, which is not in the "
                            "global layer");
      }
      region.layers_ = map::LayerChoice::kGlobalOnly;
      break;
    default:
      return InvalidField(
          FieldPath(root, "layer").ToString(),
          absl::StrFormat("%d is not a known MapLayer", request.layer()));
  }

  const DegreeLengths lengths =
      LengthsAt(south_west.latitude_deg + height_deg / 2);
  region.resolution_m_ = request.resolution_m();
  region.latitude_step_deg_ = request.resolution_m() / lengths.latitude_m;
  region.longitude_step_deg_ =
      request.resolution_m() / std::max(lengths.longitude_m, 1.0);
  // A parallel of latitude bows from the chord of two of its points by
  // w^2 tan(latitude) / (8 R) with w = dlon R cos(latitude): at most
  // dlon^2 R / 16, at 45 degrees. What the projections bend the sides of so
  // small a cell is less than the second term.
  const double longitude_step = region.longitude_step_deg_ * kRadPerDeg;
  const double latitude_step = region.latitude_step_deg_ * kRadPerDeg;
  region.bow_m_ =
      (longitude_step * longitude_step + latitude_step * latitude_step) *
      kEarthRadiusM / 16;
  // A whole number of cells must not become one more by rounding.
  const double rows =
      std::max(1.0, std::ceil(height_deg / region.latitude_step_deg_ - 1e-9));
  const double columns =
      std::max(1.0, std::ceil(width_deg / region.longitude_step_deg_ - 1e-9));
  if (rows * columns > static_cast<double>(kMaxRegionCells)) {
    return LimitExceeded(FieldPath(root, "resolution_m").ToString() + " cells",
                         static_cast<uint64_t>(std::min(rows * columns, 1e18)),
                         kMaxRegionCells);
  }
  region.rows_ = static_cast<uint32_t>(rows);
  region.columns_ = static_cast<uint32_t>(columns);
  region.north_west_ = {.latitude_deg = north_east.latitude_deg,
                        .longitude_deg = south_west.longitude_deg};
  return region;
}

absl::Status Region::Open(std::shared_ptr<const map::ObstacleMapView> view) {
  if (!activity_id_.empty()) {
    activity_ = view->FindActivity(activity_id_);
    if (activity_ == nullptr) {
      return absl::NotFoundError(absl::StrFormat(
          "activity_id=%s was never started", activity_id_.value));
    }
    if (!activity_->open()) {
      return absl::FailedPreconditionError(absl::StrFormat(
          "activity_id=%s has ended; its evidence is in the global map",
          activity_id_.value));
    }
  }
  view_ = std::move(view);
  shoalest_.emplace(*view_, ShoalestOptions{.activity = activity_,
                                            .layers = layers_,
                                            .resolution_m = resolution_m_,
                                            .bow_m = bow_m_});
  return absl::OkStatus();
}

std::optional<map::SeabedEstimate> Region::SeabedAt(
    const map::GeodeticPoint& point) const {
  if (activity_ != nullptr) return view_->SeabedInActivity(*activity_, point);
  return view_->SeabedAt(point, layers_);
}

map::GeodeticPoint Region::PointAt(double row, double column) const {
  return {.latitude_deg = std::max(
              north_west_.latitude_deg - row * latitude_step_deg_, -90.0),
          .longitude_deg =
              Wrap(north_west_.longitude_deg + column * longitude_step_deg_)};
}

void Region::Corners(uint32_t row, uint32_t first_column, uint32_t columns,
                     std::vector<map::GeodeticPoint>& out) const {
  out.clear();
  for (uint32_t column = 0; column <= columns; ++column) {
    out.push_back(PointAt(row, first_column + column));
  }
}

void Region::WriteCell(const map::GeodeticPoint& center, float shoalest_m,
                       int i, v1::RegionTile* tile) const {
  const auto seabed = SeabedAt(center);
  if (seabed.has_value()) {
    const map::DepthEstimate& estimate = seabed->estimate;
    (*tile->mutable_kind())[static_cast<size_t>(i)] =
        static_cast<char>(estimate.kind);
    (*tile->mutable_layer())[static_cast<size_t>(i)] = static_cast<char>(
        seabed->local ? v1::MAP_LAYER_LOCAL : v1::MAP_LAYER_GLOBAL);
    tile->set_depth_m(i, estimate.depth_m);
    tile->set_std_m(i, estimate.std_m);
    if (estimate.time_s != 0) {
      const double age_s = ToSeconds(now_.time_since_epoch()) -
                           static_cast<double>(estimate.time_s);
      tile->set_age_s(i, static_cast<float>(std::max(0.0, age_s)));
    }
    if (!std::isnan(estimate.hazard_m)) {
      // Rare: the array is made when the first hazard is met.
      if (tile->hazard_m().empty()) {
        tile->mutable_hazard_m()->Resize(tile->depth_m_size(), kNaN);
      }
      tile->set_hazard_m(i, estimate.hazard_m);
    }
    // fmin passes over a NaN.
    for (const float shoal_m :
         {estimate.depth_m, estimate.shoalest_m, estimate.hazard_m}) {
      shoalest_m = std::fmin(shoalest_m, shoal_m);
    }
  }
  tile->set_shoalest_m(i, shoalest_m);
}

void Region::Close() {
  shoalest_.reset();
  activity_ = nullptr;
  view_.reset();
}

bool Region::Read(const Block& block, const std::atomic<bool>& stop,
                  v1::RegionTile* tile) {
  const uint32_t rows = block.rows;
  const uint32_t columns = block.columns;
  const double north_deg =
      north_west_.latitude_deg - block.first_row * latitude_step_deg_;
  const double west_deg =
      north_west_.longitude_deg + block.first_column * longitude_step_deg_;
  tile->mutable_north_west()->set_latitude_deg(north_deg);
  tile->mutable_north_west()->set_longitude_deg(Wrap(west_deg));
  tile->set_latitude_step_deg(latitude_step_deg_);
  tile->set_longitude_step_deg(longitude_step_deg_);
  tile->set_rows(rows);
  tile->set_columns(columns);
  tile->set_first_row(block.first_row);
  tile->set_first_column(block.first_column);
  const int cells = static_cast<int>(rows * columns);
  tile->mutable_depth_m()->Resize(cells, kNaN);
  tile->mutable_std_m()->Resize(cells, kNaN);
  tile->mutable_age_s()->Resize(cells, kNaN);
  tile->mutable_shoalest_m()->Resize(cells, kNaN);
  tile->mutable_kind()->assign(static_cast<size_t>(cells), '\0');
  tile->mutable_layer()->assign(static_cast<size_t>(cells), '\0');
  std::vector<map::GeodeticPoint> north;
  std::vector<map::GeodeticPoint> south;
  std::vector<float> shoalest_m;
  Corners(block.first_row, block.first_column, columns, south);
  shoalest_->StartBlock();
  for (uint32_t row = 0; row < rows; ++row) {
    north.swap(south);
    Corners(block.first_row + row + 1, block.first_column, columns, south);
    if (!shoalest_->NextRow(north, south, stop, shoalest_m)) return false;
    for (uint32_t column = 0; column < columns; ++column) {
      WriteCell(PointAt(block.first_row + row + 0.5,
                        block.first_column + column + 0.5),
                shoalest_m[column], static_cast<int>(row * columns + column),
                tile);
    }
  }
  return true;
}

Region::Step Region::Next(const std::atomic<bool>& stop,
                          v1::GetRegionResponse* out) {
  if (next_row_ >= rows_) return Step::kEnd;
  const Block block = {
      .first_row = next_row_,
      .first_column = next_column_,
      .rows = std::min(kRegionTileSide, rows_ - next_row_),
      .columns = std::min(kRegionTileSide, columns_ - next_column_)};
  out->Clear();
  out->set_total_rows(rows_);
  out->set_total_columns(columns_);
  WriteStamp(*view_, out->mutable_stamp());
  if (!Read(block, stop, out->mutable_tile())) return Step::kStopped;
  next_column_ += block.columns;
  if (next_column_ >= columns_) {
    next_column_ = 0;
    next_row_ += block.rows;
  }
  return Step::kBlock;
}

}  // namespace fathom::server
