// The mathematics of tracking: prediction, conversion of a range and bearing,
// and the Kalman update, as pure functions.
//
// State x = [n, e, vn, ve]: metres and m/s in a north-east plane whose origin
// the caller keeps; P is its 4x4 covariance in that order. Both filters
// believe in constant velocity disturbed by white acceleration of density q
// on each axis, over the true time T between reports (thesis 5.4.2 takes T as
// constant):
//
//   F = [1 T; 0 1],   Q = q [T^3/3 T^2/2; T^2/2 T]      on each axis,
//
// which composes: predicting T1 + T2 is predicting T1, then T2 (the discrete
// form G G' sigma^2 does not). The thesis leaves S_w open (eq. 5.24); 5.16's
// T^2/2 u is an erratum for T u.
//
// - kFourState (default): one filter; range and bearing converted unbiased,
//   with the full 2x2 noise (Duan, Han, Li 2004, "Comments on 'Unbiased
//   converted measurements for tracking'", IEEE Trans. AES 40(4), 1374-1377),
//   Joseph's form of the update, which keeps P positive definite.
// - kPerAxis: the thesis's (section 5.4.4): [n vn] and [e ve] are two
//   filters; range and bearing are turned to north and east as they are
//   (eqs. 5.26, 5.27; 5.26 lacks its square root) and the correlation between
//   the axes is left out. Errata: eq. 5.13 prints S_z^-1 for
//   (C P C' + S_z)^-1, under which P can turn negative; eq. 5.12 pairs
//   y_(k+1) with C x_k, which lags a moving target by v T: the prediction
//   C A x_k is meant.
//
// Cost of a step (predict and update): about 0.1 us. Thread-safe: no state.

#ifndef FATHOM_MAP_CONTACTS_FILTER_H_
#define FATHOM_MAP_CONTACTS_FILTER_H_

#include <Eigen/Core>
#include <cstdint>
#include <string_view>

#include "absl/status/statusor.h"

namespace fathom::map {

// The numbers are stored: never reuse one.
enum class FilterKind : std::uint8_t { kPerAxis = 1, kFourState = 2 };

// "per_axis" or "four_state". Errors: INVALID_ARGUMENT, listing the names.
absl::StatusOr<FilterKind> ParseFilter(std::string_view name);
// The name; "?" for a number that is none.
std::string_view FilterName(FilterKind kind);

// An estimate: N(x, P), see the file comment. P is symmetric to the bit.
struct TrackState {
  Eigen::Vector4d x = Eigen::Vector4d::Zero();
  Eigen::Matrix4d P = Eigen::Matrix4d::Zero();
};

// The state `dt_s` seconds on, under process noise of density q (m^2/s^3).
// A negative dt_s goes back: the motion is reversed and the noise of |dt_s|
// is added, since going back is no surer than going on.
TrackState Predict(const TrackState& state, double dt_s, double q);

// A range and azimuth (clockwise from the plane's north), 1 sigma beside.
struct PolarMeasurement {
  double range_m = 0;
  double azimuth_rad = 0;
  double range_std_m = 0;
  double azimuth_std_rad = 0;
};

// A position in the plane with its noise: z = [n, e] metres, R 2x2 in m^2.
struct PositionMeasurement {
  Eigen::Vector2d z = Eigen::Vector2d::Zero();
  Eigen::Matrix2d R = Eigen::Matrix2d::Zero();
};

// The modified unbiased conversion. With s = azimuth_std^2:
//   z = e^(-s/2) r [cos a, sin a],
//   R = along the ray  (r^2 + sr^2)(1 + e^-2s)/2 - e^-s r^2,
//       across it      (r^2 + sr^2)(1 - e^-2s)/2,
// the same numbers as the usual R11, R12, R22 (domain.md section 6), written
// in the ray's own axes: positive definite and without cancellation.
PositionMeasurement ConvertUnbiased(const PolarMeasurement& polar);

// The conversion of kFourState once the contact is tracked: about the place
// predicted instead of about the place measured. `known` is the prediction
// less the sensor's place, known.P its covariance (the sensor's included).
// With M = E[p p'] = p p' + P of that place, J a quarter turn, g = sr^2 / tr M:
//   z = e^(s/2) r [cos a, sin a],
//   R = (2 sinh^2(s/2) + cosh(s) g) M + sinh(s) (1 + g) J M J',
// the best linear use of z, given that (after Bordonaro, Willett, Bar-Shalom
// 2014, "Decorrelated unbiased converted measurement Kalman filter", IEEE
// Trans. AES 50(2), 1431-1444). R does not depend on the noise of z. Where it
// does (ConvertUnbiased) a bearing that errs towards the track is trusted as
// much along the ray as one that errs away: at 10 km and 5 degrees the mean
// NEES is 7.2 instead of 4.4 and the error a sixth greater (docs/adr).
// Where `known` says less of the direction than kKnownDirection,
// ConvertUnbiased. REQUIRES: known.R positive definite.
PositionMeasurement ConvertAbout(const PolarMeasurement& polar,
                                 const PositionMeasurement& known);
inline constexpr double kKnownDirection = 0.5;  // sqrt(tr P) / |p|.
bool IsDirectionKnown(const PositionMeasurement& known);

// ConvertAbout a second time, about the place that the first time leads to:
// where the bearing is vague it is the better place (mean NEES 4.3 after 4.4 at
// 10 km and 10 degrees). REQUIRES: IsDirectionKnown(known), `first` is
// ConvertAbout(polar, known).
PositionMeasurement ConvertAgain(const PolarMeasurement& polar,
                                 const PositionMeasurement& known,
                                 const PositionMeasurement& first);

// Normalised innovation squared of the range and bearing as they are against
// the place known (first order there): chi^2 with 2 degrees of freedom. What
// is bent north and east is straight here, and the other way about.
double PolarNis(const PolarMeasurement& polar,
                const PositionMeasurement& known);

// The thesis's conversion: z = r [cos a, sin a] (inverse of eqs. 5.26, 5.27)
// with first-order noise: sr^2 along the ray, (r s_a)^2 across it.
PositionMeasurement ConvertPlain(const PolarMeasurement& polar);

// An update and what it tells about the fit.
struct UpdatedState {
  TrackState state;
  // Normalised innovation squared: chi^2 with 2 degrees of freedom when the
  // model is right.
  double nis = 0;
};

// Fuses a position into the state by the filter's rule. REQUIRES: P and R
// symmetric, P + R positive definite.
UpdatedState Update(FilterKind kind, const TrackState& state,
                    const PositionMeasurement& measurement);

// Normalised innovation squared of a position, as Update would tell it.
double PositionNis(FilterKind kind, const TrackState& state,
                   const PositionMeasurement& measurement);

// Two estimates of one state that owe nothing to each other, as one. REQUIRES:
// the sum of their P positive definite.
TrackState Fuse(const TrackState& a, const TrackState& b);

// One step back of a fixed-interval smoother (Rauch, Tung, Striebel 1965): the
// estimate `state`, dt_s >= 0 before a later one of which `predicted` was
// foretold from it (Predict by dt_s) and `smoothed` is believed now.
TrackState SmoothBack(const TrackState& state, double dt_s,
                      const TrackState& predicted, const TrackState& smoothed);

// The state of a contact that was heard once: there, velocity
// N(0, velocity_std^2) per axis.
TrackState FirstState(const PositionMeasurement& measurement,
                      double velocity_std_m_s);

}  // namespace fathom::map

#endif  // FATHOM_MAP_CONTACTS_FILTER_H_
