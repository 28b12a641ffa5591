#include "map/global/root_square.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"

namespace fathom::map {
namespace {

constexpr double kRadPerDeg = std::numbers::pi / 180.0;
constexpr double kMeanRadiusM = 6371008.8;

}  // namespace

RootSquare::Fan RootSquare::MakeFan(const Vector3& low, const Vector3& high,
                                    const Vector3& center) {
  // `low` and `high` are the sides' normals, both turned the same way.
  Fan fan;
  fan.middle = Unit(low + high);
  const Vector3 axis = Unit(Cross(low, high));
  fan.forward = Unit(Cross(fan.middle, axis));
  if (Dot(fan.forward, center) < 0) fan.forward = -fan.forward;
  fan.angle_rad = AngleBetween(low, high);
  fan.reciprocal_rad = 1 / fan.angle_rad;
  const Vector3 pole{.x = 0, .y = 0, .z = 1};
  const double turn_rad = -std::atan2(center.y, center.x);
  fan.turned_middle = Rotate(fan.middle, pole, turn_rad);
  fan.turned_forward = Rotate(fan.forward, pole, turn_rad);
  return fan;
}

Vector3 RootSquare::PlaneAt(const Fan& fan, double angle_rad) {
  return std::cos(angle_rad) * fan.middle + -std::sin(angle_rad) * fan.forward;
}

absl::StatusOr<RootSquare> RootSquare::Create(const GeodeticPoint& south_west,
                                              const GeodeticPoint& north_west,
                                              double min_cell_m) {
  FATHOM_RETURN_IF_ERROR(ValidateGeodetic(south_west));
  FATHOM_RETURN_IF_ERROR(ValidateGeodetic(north_west));
  if (!std::isfinite(min_cell_m) || min_cell_m <= 0) {
    return absl::InvalidArgumentError(
        absl::StrFormat("min_cell_m=%g must be finite and > 0", min_cell_m));
  }
  const Vector3 nw = FromGeodetic(north_west);
  const Vector3 sw = FromGeodetic(south_west);
  const double psi_rad = AngleBetween(nw, sw);
  if (psi_rad * kMeanRadiusM < kMinSideM ||
      psi_rad > kMaxSideDeg * kRadPerDeg) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "the corners of the root square are %g m (%g degrees) apart; the side "
        "must be from %g m to %g degrees",
        psi_rad * kMeanRadiusM, psi_rad / kRadPerDeg, kMinSideM, kMaxSideDeg));
  }

  RootSquare square;
  square.south_west_ = south_west;
  square.north_west_ = north_west;
  square.min_cell_m_ = min_cell_m;

  // Fig. 4-13, with r turned round so that the turn goes to the east.
  const Vector3 b = Unit(nw + sw);
  const Vector3 r = Unit(Cross(b, Unit(Cross(nw, sw))));
  const double alpha_rad = 2 * std::asin(std::tan(psi_rad / 2));
  const Vector3 ne = Unit(Rotate(nw, r, alpha_rad));
  const Vector3 se = Unit(Rotate(sw, r, alpha_rad));
  square.north_ = Unit(Cross(ne, nw));
  square.east_ = Unit(Cross(se, ne));
  square.south_ = Unit(Cross(sw, se));
  square.west_ = Unit(Cross(nw, sw));

  const Vector3 center = Unit(nw + sw + ne + se);
  square.rows_ = MakeFan(square.south_, -square.north_, center);
  square.cols_ = MakeFan(square.west_, -square.east_, center);
  square.middle_ = ToGeodetic(center);
  square.middle_latitude_ = {.sine = center.z,
                             .cosine = std::hypot(center.x, center.y)};

  const double north_south_m = DistanceM(square.Unproject({.u = 0, .v = 0.5}),
                                         square.Unproject({.u = 1, .v = 0.5}));
  const double west_east_m = DistanceM(square.Unproject({.u = 0.5, .v = 0}),
                                       square.Unproject({.u = 0.5, .v = 1}));
  for (int level = 0; level <= kMaxLevel; ++level) {
    square.cell_size_m_[static_cast<std::size_t>(level)] =
        std::ldexp(std::max(north_south_m, west_east_m), -level);
  }
  // A hair of tolerance: 1024 m in cells of 1 m are ten levels, not eleven.
  const double enough_m = min_cell_m * (1 + 1e-9);
  if (square.cell_size_m(kMaxLevel) > enough_m) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "min_cell_m=%g is too small for a square of %g m; use at least %g m",
        min_cell_m, square.cell_size_m(0), square.cell_size_m(kMaxLevel)));
  }
  while (square.cell_size_m(square.max_level_) > enough_m) ++square.max_level_;
  return square;
}

absl::StatusOr<RootSquare> RootSquare::CenteredOn(const GeodeticPoint& center,
                                                  double side_m,
                                                  double min_cell_m) {
  FATHOM_RETURN_IF_ERROR(ValidateGeodetic(center));
  if (!std::isfinite(side_m) || side_m < kMinSideM ||
      side_m > kMaxSideDeg * kRadPerDeg * kMeanRadiusM) {
    return absl::InvalidArgumentError(
        absl::StrFormat("side_m=%g must be from %g m to %g m", side_m,
                        kMinSideM, kMaxSideDeg * kRadPerDeg * kMeanRadiusM));
  }
  double psi_rad = side_m / kMeanRadiusM;
  // Beyond this the square would reach over a pole (half its diagonal).
  if (std::abs(center.latitude_deg) + 0.75 * psi_rad / kRadPerDeg >= 90) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "a square of side_m=%g about latitude_deg=%g would reach a pole",
        side_m, center.latitude_deg));
  }
  const Vector3 c = FromGeodetic(center);
  const Vector3 east = Unit(Cross({.x = 0, .y = 0, .z = 1}, c));
  const Vector3 north = Cross(c, east);
  GeodeticPoint south_west;
  GeodeticPoint north_west;
  // The middle is b turned by half of alpha; so b is the middle turned back.
  // The angle that gives side_m on the ellipsoid is found by proportion, which
  // errs by less than 1e-5 of itself a round.
  for (int round = 0; round < 4; ++round) {
    const double alpha_rad = 2 * std::asin(std::tan(psi_rad / 2));
    const Vector3 b = Rotate(c, north, -alpha_rad / 2);
    north_west =
        ToGeodetic(std::cos(psi_rad / 2) * b + std::sin(psi_rad / 2) * north);
    south_west =
        ToGeodetic(std::cos(psi_rad / 2) * b + -std::sin(psi_rad / 2) * north);
    psi_rad *= side_m / DistanceM(south_west, north_west);
  }
  return Create(south_west, north_west, min_cell_m);
}

int RootSquare::LevelFor(double cell_size_m) const {
  int level = 0;
  while (level<max_level_&& this->cell_size_m(level)> cell_size_m *
         (1 + 1e-9)) {
    ++level;
  }
  return level;
}

std::optional<LatticeBox> RootSquare::BoxAround(
    const std::array<GeodeticPoint, 4>& corners) const {
  constexpr double kCells = 1 << kMaxLevel;
  SquarePoint low{.u = 1, .v = 1};
  SquarePoint high{.u = 0, .v = 0};
  for (const GeodeticPoint& corner : corners) {
    const std::optional<SquarePoint> place = Project(corner);
    if (!place) return std::nullopt;
    low = {.u = std::min(low.u, place->u), .v = std::min(low.v, place->v)};
    high = {.u = std::max(high.u, place->u), .v = std::max(high.v, place->v)};
  }
  if (high.u < 0 || high.v < 0 || low.u >= 1 || low.v >= 1) return std::nullopt;
  const auto index = [](double fraction) {
    return static_cast<std::uint32_t>(
        std::clamp(std::floor(fraction * kCells), 0.0, kCells - 1));
  };
  return LatticeBox{.row_first = index(low.u),
                    .row_last = index(high.u),
                    .col_first = index(low.v),
                    .col_last = index(high.v)};
}

GeodeticPoint RootSquare::Unproject(const SquarePoint& point) const {
  return ToGeodetic(Meet(RowPlane(point.u), ColPlane(point.v)));
}

std::optional<CellKey> RootSquare::Locate(const GeodeticPoint& point,
                                          int level) const {
  const std::optional<LatticePoint> place = LocateLattice(point);
  if (!place) return std::nullopt;
  const int up = kMaxLevel - level;
  return CellKey{.level = static_cast<std::uint8_t>(level),
                 .row = place->row >> up,
                 .col = place->col >> up};
}

GeodeticPoint RootSquare::Center(const CellKey& cell) const {
  return Unproject({.u = std::ldexp(cell.row + 0.5, -cell.level),
                    .v = std::ldexp(cell.col + 0.5, -cell.level)});
}

std::array<GeodeticPoint, 4> RootSquare::Corners(const CellKey& cell) const {
  const double north = std::ldexp(cell.row, -cell.level);
  const double south = std::ldexp(cell.row + 1.0, -cell.level);
  const double west = std::ldexp(cell.col, -cell.level);
  const double east = std::ldexp(cell.col + 1.0, -cell.level);
  return {
      Unproject({.u = south, .v = west}), Unproject({.u = north, .v = west}),
      Unproject({.u = north, .v = east}), Unproject({.u = south, .v = east})};
}

}  // namespace fathom::map
