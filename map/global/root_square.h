// RootSquare: the approximate square on the Earth that the global map divides.
//
// The square is given by its south-west and north-west corners (Nervegna 2002,
// section 4.4.3, figs. 4-12 and 4-13). With NW and SW unit vectors, b their
// bisector and psi the angle between them, NE and SE are NW and SW turned
// eastward by alpha = 2 asin(tan(psi/2)) about the axis in the plane of NW and
// SW at right angles to b; the four sides then are great circles of equal
// length. Errata: fig. 4-13's EF-TO-GEODETIC is geodetic to Earth-fixed; and
// its r = (NW x SW) x b points south for a western side that runs north, so
// that a right-handed turn would go west: we turn about -r.
//
// Two angles in place of planes (a departure; domain.md, section 5). The thesis
// stores four plane normals in each cell and bisects opposite ones (fig. 4-17).
// All planes between the north and the south one hold one line, N x S, so
// repeated bisection is equal angles about that line, and likewise between
// east and west. A point therefore has two fractions (u from the north, v from
// the west, each 0..1), a cell is two integers, and nothing is stored per cell.
// map/global/thesis_planes.h keeps the thesis's descent; a test finds the same
// leaf by both.
//
// Immutable after Create; thread-safe; a few hundred bytes, copied freely.

#ifndef FATHOM_MAP_GLOBAL_ROOT_SQUARE_H_
#define FATHOM_MAP_GLOBAL_ROOT_SQUARE_H_

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>

#include "absl/status/statusor.h"
#include "map/geodesy/points.h"
#include "map/geodesy/small_angle.h"
#include "map/global/cell_key.h"
#include "map/global/unit_vector.h"

namespace fathom::map {

// A place in the root square: fractions of the angle between opposite sides.
// Inside the square both are in [0, 1].
struct SquarePoint {
  double u = 0;  // From the north side.
  double v = 0;  // From the west side.
};

// A place in the square on the lattice of level kMaxLevel.
struct LatticePoint {
  std::uint32_t row = 0;
  std::uint32_t col = 0;
};

// A rectangle of lattice cells; ends are included.
struct LatticeBox {
  std::uint32_t row_first = 0;
  std::uint32_t row_last = 0;
  std::uint32_t col_first = 0;
  std::uint32_t col_last = 0;
};

class RootSquare {
 public:
  // The longest side, as an angle at the Earth's centre. At 90 degrees the
  // square degenerates (alpha becomes 180 degrees); at 60 its cells still
  // differ by less than a factor of 1.5 in size.
  static constexpr double kMaxSideDeg = 60.0;
  // The shortest side: below it a fraction would be worth less than 1 nm.
  static constexpr double kMinSideM = 1.0;

  // What of a side still counts as inside: rounding of a corner, not a metre.
  static constexpr double kEdgeFraction = 1e-12;

  // A square that holds no point.
  RootSquare() = default;

  // The square whose west side runs from `south_west` to `north_west`, divided
  // down to the first level whose cells are not larger than `min_cell_m` (fig.
  // 4-15, lines 7-9: such a cell is the smallest that is made).
  // Errors: INVALID_ARGUMENT for corners that are not valid points, a side
  // outside [kMinSideM, kMaxSideDeg], a `min_cell_m` that is not finite and
  // > 0, or one that needs more than kMaxLevel levels.
  static absl::StatusOr<RootSquare> Create(const GeodeticPoint& south_west,
                                           const GeodeticPoint& north_west,
                                           double min_cell_m);

  // The square with its middle at `center`, sides of `side_m` (west side,
  // along the ellipsoid, to a millimetre), northward where its middle is.
  // Errors: as Create, and INVALID_ARGUMENT where a pole would be inside.
  static absl::StatusOr<RootSquare> CenteredOn(const GeodeticPoint& center,
                                               double side_m,
                                               double min_cell_m);

  // The corners as given: Create(south_west(), north_west(), min_cell_m())
  // makes an identical square.
  const GeodeticPoint& south_west() const { return south_west_; }
  const GeodeticPoint& north_west() const { return north_west_; }
  double min_cell_m() const { return min_cell_m_; }

  // Level of the smallest cells, 0..kMaxLevel.
  int max_level() const { return max_level_; }

  // Side of a cell at the middle of the square, metres along the ellipsoid:
  // the larger of its two sides. Towards the square's sides cells get smaller
  // (by 1.7 % at the side of a square of 1267 nmi, 2 ppm in one of 20 nmi).
  // REQUIRES: 0 <= level <= kMaxLevel.
  double cell_size_m(int level) const {
    return cell_size_m_[static_cast<std::size_t>(level)];
  }

  // The coarsest level with cells not larger than `cell_size_m`, at most
  // max_level(). REQUIRES: cell_size_m > 0.
  int LevelFor(double cell_size_m) const;

  // Where the point is; also outside the square, as long as it is on the same
  // side of the Earth (less than 90 degrees from both middle planes).
  // REQUIRES: finite coordinates (else nullopt). About 15 ns within kSmallRad
  // of the middle, 45 ns elsewhere.
  std::optional<SquarePoint> Project(const GeodeticPoint& point) const;

  // The point at the given fractions. About 100 ns.
  GeodeticPoint Unproject(const SquarePoint& point) const;

  // Unproject in two steps, for grids of points: the plane of a row and that of
  // a column, and the direction in which they meet (of any length). 30 ns each.
  Vector3 RowPlane(double u) const {
    return PlaneAt(rows_, (0.5 - u) * rows_.angle_rad);
  }
  Vector3 ColPlane(double v) const {
    return PlaneAt(cols_, (v - 0.5) * cols_.angle_rad);
  }
  static Vector3 Meet(const Vector3& row_plane, const Vector3& col_plane) {
    return Cross(col_plane, row_plane);
  }

  // The lattice cell that holds the point; nullopt if it is outside. The
  // square's sides count as inside (1e-12 of a side).
  std::optional<LatticePoint> LocateLattice(const GeodeticPoint& point) const;

  // The least box about the quadrilateral with these corners (its sides, as
  // great circles, are sides of it within their length squared / 8 Earth radii:
  // 5 cm at 1.6 km), clipped to the square; nullopt if it lies outside or a
  // corner does not project.
  std::optional<LatticeBox> BoxAround(
      const std::array<GeodeticPoint, 4>& corners) const;

  // The cell of `level` that holds the point; nullopt if it is outside.
  // REQUIRES: 0 <= level <= kMaxLevel.
  std::optional<CellKey> Locate(const GeodeticPoint& point, int level) const;

  // The cell's middle: half of both angles.
  GeodeticPoint Center(const CellKey& cell) const;

  // The cell's corners: south-west, north-west, north-east, south-east.
  std::array<GeodeticPoint, 4> Corners(const CellKey& cell) const;

  // Inward unit normals of the four side planes of the root (fig. 4-13, lines
  // 9-12): where the thesis's descent starts.
  const Vector3& north_normal() const { return north_; }
  const Vector3& east_normal() const { return east_; }
  const Vector3& south_normal() const { return south_; }
  const Vector3& west_normal() const { return west_; }

 private:
  // The planes between two opposite sides. A direction p lies on the plane at
  // the signed angle atan2(p . middle, p . forward) from the middle plane.
  struct Fan {
    Vector3 middle;   // Normal of the plane halfway, towards north or east.
    Vector3 forward;  // In the halfway plane, towards the square.
    double angle_rad = 0;       // Between the two sides.
    double reciprocal_rad = 0;  // 1 / angle_rad.
    // Both again, turned about the pole until the square's middle has
    // longitude 0.
    Vector3 turned_middle;
    Vector3 turned_forward;
  };
  static Fan MakeFan(const Vector3& low, const Vector3& high,
                     const Vector3& center);
  // Normal of the plane `angle_rad` from the middle one.
  static Vector3 PlaneAt(const Fan& fan, double angle_rad);

  GeodeticPoint south_west_;
  GeodeticPoint north_west_;
  double min_cell_m_ = 0;
  int max_level_ = 0;
  Vector3 north_, east_, south_, west_;
  Fan rows_;  // From the south plane (low) to the north plane (high).
  Fan cols_;  // From the west plane to the east plane.
  GeodeticPoint middle_;
  SineCosine middle_latitude_;
  std::array<double, kMaxLevel + 1> cell_size_m_{};
};

// Inline, for they are in every query: a call that returns an optional through
// memory costs 15 ns.
[[gnu::always_inline]] inline std::optional<SquarePoint> RootSquare::Project(
    const GeodeticPoint& point) const {
  // The direction of the point, in axes turned about the pole until the middle
  // has longitude 0.
  const double north_rad =
      (point.latitude_deg - middle_.latitude_deg) * (std::numbers::pi / 180.0);
  const double east_rad = EastOfRad(middle_, point);
  const bool small =
      std::fabs(north_rad) < kSmallRad && std::fabs(east_rad) < kSmallRad;
  Vector3 p;
  if (small) {
    const SineCosine north = SineCosineOfSmall(north_rad);
    const SineCosine east = SineCosineOfSmall(east_rad);
    const double equatorial = middle_latitude_.cosine * north.cosine -
                              middle_latitude_.sine * north.sine;
    p = {equatorial * east.cosine, equatorial * east.sine,
         middle_latitude_.sine * north.cosine +
             middle_latitude_.cosine * north.sine};
  } else {
    p = FromGeodetic(
        {.latitude_deg = point.latitude_deg,
         .longitude_deg = point.longitude_deg - middle_.longitude_deg});
  }
  const double rows_forward = Dot(p, rows_.turned_forward);
  const double cols_forward = Dot(p, cols_.turned_forward);
  // Written so that NaN and a default-made square give nothing.
  if (!(rows_forward > 0 && cols_forward > 0)) return std::nullopt;
  const double rows = Dot(p, rows_.turned_middle) / rows_forward;
  const double cols = Dot(p, cols_.turned_middle) / cols_forward;
  const double rows_rad = small ? ArcTangentOfSmall(rows) : std::atan(rows);
  const double cols_rad = small ? ArcTangentOfSmall(cols) : std::atan(cols);
  return SquarePoint{.u = 0.5 - rows_rad * rows_.reciprocal_rad,
                     .v = 0.5 + cols_rad * cols_.reciprocal_rad};
}

[[gnu::always_inline]] inline std::optional<LatticePoint>
RootSquare::LocateLattice(const GeodeticPoint& point) const {
  constexpr std::int32_t kCells = 1 << kMaxLevel;
  const std::optional<SquarePoint> place = Project(point);
  // Written so that NaN is outside.
  const auto inside = [](double fraction) {
    return fraction >= -kEdgeFraction && fraction <= 1 + kEdgeFraction;
  };
  if (!place || !inside(place->u) || !inside(place->v)) return std::nullopt;
  // Rounds towards zero: fractions from -kEdgeFraction on give 0.
  const auto row = static_cast<std::int32_t>(place->u * kCells);
  const auto col = static_cast<std::int32_t>(place->v * kCells);
  return LatticePoint{
      .row = static_cast<std::uint32_t>(std::min(row, kCells - 1)),
      .col = static_cast<std::uint32_t>(std::min(col, kCells - 1))};
}

}  // namespace fathom::map

#endif  // FATHOM_MAP_GLOBAL_ROOT_SQUARE_H_
