#include "map/contacts/filter.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>

#include "absl/status/status.h"
#include "absl/strings/str_format.h"

namespace fathom::map {
namespace {

// Copies the upper triangle into the lower, so that P is symmetric to the bit.
void Symmetrize(Eigen::Matrix4d& P) {
  for (int row = 0; row < 4; ++row) {
    for (int col = row + 1; col < 4; ++col) P(col, row) = P(row, col);
  }
}

// The 2x2 covariance with the given variances along and across a ray.
Eigen::Matrix2d AlongRay(double cos_a, double sin_a, double along,
                         double across) {
  Eigen::Matrix2d R;
  R(0, 0) = along * cos_a * cos_a + across * sin_a * sin_a;
  R(1, 1) = along * sin_a * sin_a + across * cos_a * cos_a;
  R(0, 1) = R(1, 0) = (along - across) * sin_a * cos_a;
  return R;
}

// Four states, Joseph's form: P = (I - K C) P (I - K C)' + K R K'.
UpdatedState UpdateFourState(const TrackState& prior,
                             const PositionMeasurement& measurement) {
  const Eigen::Vector2d innovation = measurement.z - prior.x.head<2>();
  const Eigen::Matrix2d S = prior.P.topLeftCorner<2, 2>() + measurement.R;
  const Eigen::Matrix2d S_inverse = S.inverse();
  const Eigen::Matrix<double, 4, 2> K = prior.P.leftCols<2>() * S_inverse;
  Eigen::Matrix4d A = Eigen::Matrix4d::Identity();
  A.leftCols<2>() -= K;
  UpdatedState updated;
  updated.state.x = prior.x + K * innovation;
  updated.state.P =
      A * prior.P * A.transpose() + K * measurement.R * K.transpose();
  Symmetrize(updated.state.P);
  updated.nis = innovation.dot(S_inverse * innovation);
  return updated;
}

// Two [p v] filters, eqs. 5.11-5.13 with the errata of filter.h: the
// covariance C P C' + S_z is a scalar. What is between the axes stays as it
// was predicted: 0 in a track that this filter began.
UpdatedState UpdatePerAxis(const TrackState& prior,
                           const PositionMeasurement& measurement) {
  UpdatedState updated{.state = prior, .nis = 0.0};
  for (int axis = 0; axis < 2; ++axis) {
    const int p = axis;
    const int v = axis + 2;
    const double innovation = measurement.z(axis) - prior.x(p);
    const double r = measurement.R(axis, axis);
    const double s = prior.P(p, p) + r;
    const double k_p = prior.P(p, p) / s;
    const double k_v = prior.P(p, v) / s;
    updated.state.x(p) += k_p * innovation;
    updated.state.x(v) += k_v * innovation;
    Eigen::Matrix4d& P = updated.state.P;
    P(p, p) = k_p * r;  // (1 - k_p) P, without cancellation.
    P(p, v) = P(v, p) = prior.P(p, v) * (r / s);
    P(v, v) = prior.P(v, v) - k_v * prior.P(p, v);
    updated.nis += innovation * innovation / s;
  }
  // The axes are independent by assumption (section 5.4.4); a fix or a change
  // of the plane may have left a trace between them.
  Eigen::Matrix4d& P = updated.state.P;
  P(0, 1) = P(1, 0) = P(0, 3) = P(3, 0) = 0.0;
  P(2, 1) = P(1, 2) = P(2, 3) = P(3, 2) = 0.0;
  return updated;
}

}  // namespace

absl::StatusOr<FilterKind> ParseFilter(std::string_view name) {
  if (name == "per_axis") return FilterKind::kPerAxis;
  if (name == "four_state") return FilterKind::kFourState;
  return absl::InvalidArgumentError(absl::StrFormat(
      "filter=\"%s\" must be per_axis or four_state", std::string(name)));
}

std::string_view FilterName(FilterKind kind) {
  switch (kind) {
    case FilterKind::kPerAxis:
      return "per_axis";
    case FilterKind::kFourState:
      return "four_state";
  }
  return "?";
}

TrackState Predict(const TrackState& state, double dt_s, double q) {
  TrackState next = state;
  next.x.head<2>() += dt_s * state.x.tail<2>();
  const Eigen::Matrix4d& P = state.P;
  // F P F' with F = [I, T I; 0, I], block by block.
  next.P.topLeftCorner<2, 2>() =
      P.topLeftCorner<2, 2>() +
      dt_s * (P.topRightCorner<2, 2>() + P.bottomLeftCorner<2, 2>()) +
      dt_s * dt_s * P.bottomRightCorner<2, 2>();
  next.P.topRightCorner<2, 2>() =
      P.topRightCorner<2, 2>() + dt_s * P.bottomRightCorner<2, 2>();
  const double span_s = std::fabs(dt_s);
  for (int axis = 0; axis < 2; ++axis) {
    next.P(axis, axis) += q * span_s * span_s * span_s / 3.0;
    next.P(axis, axis + 2) += q * dt_s * span_s / 2.0;
    next.P(axis + 2, axis + 2) += q * span_s;
  }
  Symmetrize(next.P);
  return next;
}

PositionMeasurement ConvertUnbiased(const PolarMeasurement& polar) {
  const double r = polar.range_m;
  const double s = polar.azimuth_std_rad * polar.azimuth_std_rad;
  const double cos_a = std::cos(polar.azimuth_rad);
  const double sin_a = std::sin(polar.azimuth_rad);
  const double shrink = std::exp(-0.5 * s);
  const double range_variance = polar.range_std_m * polar.range_std_m;
  // (1 + e^-2s)/2 - e^-s = (1 - e^-s)^2 / 2, and both differences by expm1.
  const double bend = std::expm1(-s);
  const double twice = std::expm1(-2.0 * s);
  const double along =
      0.5 * r * r * bend * bend + range_variance * (1.0 + 0.5 * twice);
  const double across = -0.5 * twice * (r * r + range_variance);
  return {.z = {shrink * r * cos_a, shrink * r * sin_a},
          .R = AlongRay(cos_a, sin_a, along, across)};
}

PositionMeasurement ConvertAbout(const PolarMeasurement& polar,
                                 const PositionMeasurement& known) {
  const Eigen::Vector2d& p = known.z;
  if (!IsDirectionKnown(known)) return ConvertUnbiased(polar);
  const double s = polar.azimuth_std_rad * polar.azimuth_std_rad;
  const Eigen::Matrix2d M = p * p.transpose() + known.R;
  Eigen::Matrix2d turned;  // J M J'.
  turned << M(1, 1), -M(0, 1), -M(0, 1), M(0, 0);
  const double g = polar.range_std_m * polar.range_std_m / M.trace();
  const double half = std::sinh(0.5 * s);
  const double stretched_m = std::exp(0.5 * s) * polar.range_m;
  return {.z = {stretched_m * std::cos(polar.azimuth_rad),
                stretched_m * std::sin(polar.azimuth_rad)},
          .R = (2.0 * half * half + std::cosh(s) * g) * M +
               std::sinh(s) * (1.0 + g) * turned};
}

bool IsDirectionKnown(const PositionMeasurement& known) {
  return known.R.trace() <=
         kKnownDirection * kKnownDirection * known.z.squaredNorm();
}

PositionMeasurement ConvertAgain(const PolarMeasurement& polar,
                                 const PositionMeasurement& known,
                                 const PositionMeasurement& first) {
  const Eigen::Matrix2d S = known.R + first.R;
  const Eigen::Matrix2d K = known.R * S.inverse();
  PositionMeasurement led{.z = known.z + K * (first.z - known.z),
                          .R = known.R - K * known.R};
  led.R(1, 0) = led.R(0, 1);
  return ConvertAbout(polar, led);
}

double PolarNis(const PolarMeasurement& polar,
                const PositionMeasurement& known) {
  const double range_m = known.z.norm();
  if (range_m == 0.0) return std::numeric_limits<double>::infinity();
  const Eigen::Vector2d along = known.z / range_m;
  const Eigen::Vector2d across(-along.y(), along.x());
  const double d_range_m = polar.range_m - range_m;
  const double d_azimuth_rad =
      std::remainder(polar.azimuth_rad - std::atan2(along.y(), along.x()),
                     2 * std::numbers::pi);
  const double rr =
      along.dot(known.R * along) + polar.range_std_m * polar.range_std_m;
  const double ra = along.dot(known.R * across) / range_m;
  const double aa = across.dot(known.R * across) / (range_m * range_m) +
                    polar.azimuth_std_rad * polar.azimuth_std_rad;
  return (aa * d_range_m * d_range_m - 2 * ra * d_range_m * d_azimuth_rad +
          rr * d_azimuth_rad * d_azimuth_rad) /
         (rr * aa - ra * ra);
}

PositionMeasurement ConvertPlain(const PolarMeasurement& polar) {
  const double cos_a = std::cos(polar.azimuth_rad);
  const double sin_a = std::sin(polar.azimuth_rad);
  const double across_m = polar.range_m * polar.azimuth_std_rad;
  return {.z = {polar.range_m * cos_a, polar.range_m * sin_a},
          .R = AlongRay(cos_a, sin_a, polar.range_std_m * polar.range_std_m,
                        across_m * across_m)};
}

UpdatedState Update(FilterKind kind, const TrackState& state,
                    const PositionMeasurement& measurement) {
  return kind == FilterKind::kPerAxis ? UpdatePerAxis(state, measurement)
                                      : UpdateFourState(state, measurement);
}

double PositionNis(FilterKind kind, const TrackState& state,
                   const PositionMeasurement& measurement) {
  const Eigen::Vector2d innovation = measurement.z - state.x.head<2>();
  Eigen::Matrix2d S = state.P.topLeftCorner<2, 2>() + measurement.R;
  if (kind == FilterKind::kPerAxis) S(0, 1) = S(1, 0) = 0.0;
  return innovation.dot(S.inverse() * innovation);
}

TrackState Fuse(const TrackState& a, const TrackState& b) {
  // Joseph's form with gain K = P_a (P_a + P_b)^-1.
  const Eigen::Matrix4d sum = a.P + b.P;
  const Eigen::Matrix4d K = sum.ldlt().solve(a.P).transpose();
  const Eigen::Matrix4d rest = Eigen::Matrix4d::Identity() - K;
  TrackState fused;
  fused.x = a.x + K * (b.x - a.x);
  fused.P = rest * a.P * rest.transpose() + K * b.P * K.transpose();
  Symmetrize(fused.P);
  return fused;
}

TrackState SmoothBack(const TrackState& state, double dt_s,
                      const TrackState& predicted, const TrackState& smoothed) {
  // Gain P F' (predicted P)^-1, transposed.
  Eigen::Matrix4d moved = state.P;  // P F'.
  moved.leftCols<2>() += dt_s * state.P.rightCols<2>();
  const Eigen::Matrix4d gain_t = predicted.P.ldlt().solve(moved.transpose());
  TrackState back;
  back.x = state.x + gain_t.transpose() * (smoothed.x - predicted.x);
  back.P = state.P + gain_t.transpose() * (smoothed.P - predicted.P) * gain_t;
  Symmetrize(back.P);
  return back;
}

TrackState FirstState(const PositionMeasurement& measurement,
                      double velocity_std_m_s) {
  TrackState state;
  state.x.head<2>() = measurement.z;
  state.P.topLeftCorner<2, 2>() = measurement.R;
  state.P(2, 2) = state.P(3, 3) = velocity_std_m_s * velocity_std_m_s;
  return state;
}

}  // namespace fathom::map
