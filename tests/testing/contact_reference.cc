#include "tests/testing/contact_reference.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "map/query/closest_approach.h"
#include "map/query/disc_probability.h"
#include "tests/testing/shared_numbers.h"
#include "tests/testing/worse.h"

namespace fathom::testing {
namespace {

using map::FilterKind;
using map::GeodeticPoint;
using map::PositionMeasurement;
using map::TrackState;

constexpr double kRadPerDeg = std::numbers::pi / 180;
constexpr double kKnotMPerS = 1852.0 / 3600;

Eigen::Vector2d Along(double length, double course_deg) {
  return {length * std::cos(course_deg * kRadPerDeg),
          length * std::sin(course_deg * kRadPerDeg)};
}

PositionMeasurement At(double north_m, double east_m, double variance_m2) {
  return {.z = {north_m, east_m},
          .R = Eigen::Matrix2d::Identity() * variance_m2};
}

Eigen::Matrix2d Diagonal(double std_north_m, double std_east_m) {
  return Eigen::Vector2d(std_north_m * std_north_m, std_east_m * std_east_m)
      .asDiagonal();
}

// Where a great circle of a sphere leads.
GeodeticPoint OnSphere(const GeodeticPoint& from, double course_deg,
                       double way_m) {
  constexpr double kMeanRadiusM = 6'371'008.771415;  // The reference's.
  const double a = way_m / kMeanRadiusM;
  const double lat = from.latitude_deg * kRadPerDeg;
  const double course = course_deg * kRadPerDeg;
  const double sin_there = std::sin(lat) * std::cos(a) +
                           std::cos(lat) * std::sin(a) * std::cos(course);
  const double turn = std::atan2(std::sin(course) * std::sin(a) * std::cos(lat),
                                 std::cos(a) - std::sin(lat) * sin_there);
  return {.latitude_deg = std::asin(sin_there) / kRadPerDeg,
          .longitude_deg = from.longitude_deg + turn / kRadPerDeg};
}

}  // namespace

ReferenceErrors ConversionErrors(const std::string& folder, FilterKind kind) {
  const bool plain = kind == FilterKind::kPerAxis;
  ReferenceErrors errors;
  for (const std::string& line :
       LinesOf(folder + "/nrl_reference_octave.txt")) {
    if (line.starts_with("=== NEES")) break;
    const std::vector<double> n = NumbersIn(line);
    // r theta_deg sr st_deg alg x y R11 R12 R22; 0: standard, 3: modified
    // unbiased.
    if (line.starts_with("===") || n.size() != 10 || n[4] != (plain ? 0 : 3)) {
      continue;
    }
    const map::PolarMeasurement polar{.range_m = n[0],
                                      .azimuth_rad = n[1] * kRadPerDeg,
                                      .range_std_m = n[2],
                                      .azimuth_std_rad = n[3] * kRadPerDeg};
    const PositionMeasurement got =
        plain ? ConvertPlain(polar) : ConvertUnbiased(polar);
    const Eigen::Vector2d z(n[5], n[6]);
    Eigen::Matrix2d R;
    R << n[7], n[8], n[8], n[9];
    errors.push_back(
        {line,
         WorseOf((got.z - z).cwiseAbs().maxCoeff<Eigen::PropagateNaN>() / n[0],
                 (got.R - R).cwiseAbs().maxCoeff<Eigen::PropagateNaN>() /
                     R.trace())});
  }
  return errors;
}

ReferenceErrors KalmanStepErrors(const std::string& folder) {
  const auto lines = LinesOf(folder + "/stonesoup_reference.txt");
  if (lines.empty()) return {};
  const auto numbers = [&lines](const std::string& start) {
    for (const std::string& line : lines) {
      if (line.starts_with(start)) return NumbersIn(line);
    }
    return std::vector<double>();
  };
  // State order there: [x vx y vy].
  const int order[4] = {0, 2, 1, 3};
  const auto read = [&](const std::string& start) {
    const std::vector<double> n = numbers(start);
    TrackState state;
    for (int r = 0; r < 4; ++r) {
      state.x(order[r]) = n.at(static_cast<std::size_t>(r));
      for (int c = 0; c < 4; ++c) {
        state.P(order[r], order[c]) = n.at(4 + 4 * static_cast<std::size_t>(r) +
                                           static_cast<std::size_t>(c));
      }
    }
    return state;
  };
  // "CV F [[1, T], [0, 1]] Q [[..], [..]]": T = 5, q = 0.1.
  const std::vector<double> cv = numbers("CV ");
  const TrackState noise = Predict(TrackState{}, cv.at(1), 0.1);
  Eigen::Matrix2d Q;
  Q << cv.at(4), cv.at(5), cv.at(6), cv.at(7);
  Eigen::Matrix2d ours;
  ours << noise.P(0, 0), noise.P(0, 2), noise.P(2, 0), noise.P(2, 2);
  // The file tells no measurement; it follows from it. R: 533.33 R /
  // (533.33 + R) = 158.24, R = 225; z: 7.033 / 0.7033 = 10 from 970, 510.
  const map::UpdatedState got =
      Update(FilterKind::kFourState, read("pred x"), At(980, 510, 225));
  const TrackState expected = read("KF x");
  return {{"process noise", (ours - Q).norm()},
          {"state", (got.state.x - expected.x).norm()},
          {"covariance", (got.state.P - expected.P).norm()},
          {"NIS", std::fabs(got.nis - numbers("NIS ").at(0))}};
}

ReferenceErrors SteadyStateErrors(const std::string& folder, FilterKind kind) {
  ReferenceErrors errors;
  for (const std::string& line :
       LinesOf(folder + "/steady_state_alpha_beta.csv")) {
    if (!line.starts_with("CWNA,")) continue;
    // T q R K_pos K_vel P11 P12 P22.
    const std::vector<double> n = NumbersIn(line);
    TrackState state = map::FirstState(At(0, 0, n[2]), 10);
    for (int k = 0; k < 2000; ++k) {
      state = Update(kind, Predict(state, n[0], n[1]), At(0, 0, n[2])).state;
    }
    double worst = 0;
    for (int axis = 0; axis < 2; ++axis) {
      const double pp = state.P(axis, axis);
      const double pv = state.P(axis, axis + 2);
      const double vv = state.P(axis + 2, axis + 2);
      // K = P C' R^-1 with the updated P.
      const double ours[] = {pp / n[2], pv / n[2], pp, pv, vv};
      for (std::size_t i = 0; i < 5; ++i) {
        worst = WorseOf(worst, std::fabs(ours[i] / n[3 + i] - 1));
      }
    }
    errors.push_back({line, worst});
  }
  return errors;
}

std::vector<DiscCase> PublishedDiscs(const std::string& folder) {
  std::vector<DiscCase> cases;
  for (const std::string& line :
       LinesOf(folder + "/disc_probability_published.csv")) {
    if (!line.starts_with("Chan")) continue;
    // xm ym sigmaX sigmaY radius expected_P test_tol quadrature_P.
    const std::vector<double> n = NumbersIn(line.substr(line.find(',')));
    cases.push_back({.row = line,
                     .offset_m = {n[0], n[1]},
                     .covariance_m2 = Diagonal(n[2], n[3]),
                     .radius_m = n[4],
                     .probability = n[7],
                     .printed = n[5],
                     .printed_within = n[6]});
  }
  return cases;
}

std::vector<DiscCase> IsotropicDiscs(const std::string& folder) {
  std::vector<DiscCase> cases;
  for (const std::string& line :
       LinesOf(folder + "/isotropic_disk_probability.csv")) {
    if (line.starts_with("d_m")) continue;
    const std::vector<double> n = NumbersIn(line);  // d sigma radius P
    cases.push_back({.row = line,
                     .offset_m = {n[0], 0},
                     .covariance_m2 = Diagonal(n[1], n[1]),
                     .radius_m = n[2],
                     .probability = n[3]});
  }
  return cases;
}

double IsotropicSeries(double d, double s, double radius) {
  const long double lambda = static_cast<long double>(d / s) * (d / s) / 2;
  const long double y = static_cast<long double>(radius / s) * (radius / s) / 2;
  long double sum = 0;
  for (int k = 0; k < 4000; ++k) {
    const long double weight =
        expl(-lambda + (k == 0 ? 0 : k * logl(lambda)) - lgammal(k + 1.0L));
    if (lambda == 0 && k > 0) break;
    // e^-y sum over j > k of y^j / j!.
    long double term = expl(-y + (k + 1) * logl(y) - lgammal(k + 2.0L));
    long double tail = 0;
    for (int j = k + 1; term > tail * 1e-20L || j < y; ++j) {
      tail += term;
      term *= y / (j + 1);
      if (term == 0 && j > y) break;
    }
    sum += weight * tail;
    if (k > lambda && weight * tail < sum * 1e-16L) break;
  }
  return static_cast<double>(sum);
}

double ManyChords(double p, double q, double major, double minor,
                  double radius) {
  const auto cdf = [](long double x) { return 0.5L * erfcl(-x / sqrtl(2.0L)); };
  // Enough to resolve the minor axis anywhere on the disc.
  const int chords = 2000 + static_cast<int>(40 * radius / minor);
  const long double step = std::numbers::pi_v<long double> / chords;
  long double sum = 0;
  for (int i = 0; i < chords; ++i) {
    const long double t =
        -std::numbers::pi_v<long double> / 2 + (i + 0.5L) * step;
    const long double along = (radius * sinl(t) - p) / major;
    const long double chord = radius * cosl(t);
    long double low = (q - chord) / minor;
    long double high = (q + chord) / minor;
    if (low + high > 0) {
      const long double flipped = -low;
      low = -high;
      high = flipped;
    }
    sum += expl(-along * along / 2) * chord * (cdf(high) - cdf(low));
  }
  return static_cast<double>(
      sum * step / (major * sqrtl(2 * std::numbers::pi_v<long double>)));
}

std::vector<DiscCase> SummedIsotropicDiscs(int count) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> unit(0, 1);
  std::vector<DiscCase> cases;
  for (int i = 0; i < count; ++i) {
    const double s = 10;
    const double radius = s * std::pow(10, -2 + 3.3 * unit(random));
    const double d = std::max(0.0, radius + s * (11 * unit(random) - 3));
    const double expected = IsotropicSeries(d, s, radius);
    if (expected < 1e-12) continue;
    const double angle = 7 * unit(random);
    cases.push_back({.row = std::to_string(i),
                     .offset_m = {d * std::cos(angle), d * std::sin(angle)},
                     .covariance_m2 = Diagonal(s, s),
                     .radius_m = radius,
                     .probability = expected});
  }
  return cases;
}

std::vector<DiscCase> SummedEllipticDiscs(int count) {
  std::mt19937_64 random(6);
  std::uniform_real_distribution<double> unit(0, 1);
  std::vector<DiscCase> cases;
  for (int i = 0; i < count; ++i) {
    const double radius = std::pow(10, 3 * unit(random));
    const double major = radius * std::pow(10, -1.5 + 4 * unit(random));
    const double minor = major * std::pow(10, -2 * unit(random) * unit(random));
    const double turn = 7 * unit(random);
    const double out = 7 * unit(random);
    const double at = 7 * unit(random);
    const double p = std::cos(at) * (out * major + radius * unit(random));
    const double q = std::sin(at) * (out * minor + radius * unit(random));
    const double expected = ManyChords(p, q, major, minor, radius);
    if (expected < 1e-12) continue;
    Eigen::Matrix2d axes;
    axes << std::cos(turn), -std::sin(turn), std::sin(turn), std::cos(turn);
    cases.push_back(
        {.row = std::to_string(i),
         .offset_m = axes * Eigen::Vector2d(p, q),
         .covariance_m2 = axes * Diagonal(major, minor) * axes.transpose(),
         .radius_m = radius,
         .probability = expected});
  }
  return cases;
}

double RelativeError(const DiscCase& one) {
  return std::fabs(
      map::DiscProbability(one.offset_m, one.covariance_m2, one.radius_m) /
          one.probability -
      1);
}

ReferenceErrors EncounterErrors(const std::string& folder) {
  ReferenceErrors errors;
  const auto lines = LinesOf(folder + "/cpa_encounters.csv");
  for (std::size_t i = 1; i < lines.size(); ++i) {
    // The title is in quotes and may hold a comma. Behind it: range bearing
    // tcpa_min distance time_input own_kn target_kn.
    const auto n = NumbersIn(lines[i].substr(lines[i].rfind('"') + 1));
    if (n.size() != 7) {
      errors.push_back({lines[i], std::numeric_limits<double>::infinity()});
      continue;
    }
    const Eigen::Vector2d offset = Along(n[0], n[1]);
    const Eigen::Vector2d own = Along(n[5] * kKnotMPerS, 0);
    const auto missed = [&](double course_deg) {
      const map::PlaneApproach approach = map::FindApproach(
          {.offset_m = offset,
           .velocity_m_s = Along(n[6] * kKnotMPerS, course_deg) - own});
      return WorseOf(std::fabs(approach.tcpa_s / 60 - n[2]) / 0.001,
                     std::fabs(approach.distance_m - n[3]) / 0.2);
    };
    double best_deg = 0;
    for (double step = 0.002, low = 0, high = 360; step > 1e-6; step /= 20) {
      for (double course = low; course <= high; course += step) {
        if (missed(course) < missed(best_deg)) best_deg = course;
      }
      low = best_deg - step;
      high = best_deg + step;
    }
    errors.push_back({lines[i], missed(best_deg)});
  }
  return errors;
}

// The aircraft flies 154 m/s: the track is put in place, no report would be
// believed.
std::vector<SphereError> SphereEncounterErrors(const std::string& folder) {
  std::vector<SphereError> errors;
  for (const std::string& line : LinesOf(folder + "/jord_cpa.csv")) {
    if (line.starts_with("#") || line.starts_with("own_lat")) continue;
    const auto n = NumbersIn(line);
    const double tcpa_s = n.at(8);
    const auto own_at = [&n](double t_s) {
      return OnSphere({n[0], n[1]}, n[2], n[3] * kKnotMPerS * t_s);
    };
    const auto target_at = [&n](double t_s) {
      return OnSphere({n[4], n[5]}, n[6], n[7] * kKnotMPerS * t_s);
    };
    SphereError error;
    error.place_deg =
        std::max({std::fabs(own_at(tcpa_s).latitude_deg - n.at(10)),
                  std::fabs(own_at(tcpa_s).longitude_deg - n.at(11)),
                  std::fabs(target_at(tcpa_s).latitude_deg - n.at(12)),
                  std::fabs(target_at(tcpa_s).longitude_deg - n.at(13))});
    constexpr std::chrono::seconds kTenMinutes(600);
    const Time begin_time{};
    map::ContactPoint begin;
    begin.contact_class = map::ContactClass::kVessel;
    begin.status = map::ContactStatus::kActive;
    begin.time = begin.report_time = begin.track_start = begin_time;
    begin.frame_origin = target_at(tcpa_s - 600);
    const double azimuth_deg =
        Inverse(begin.frame_origin, target_at(tcpa_s)).azimuth_deg;
    begin.x.tail<2>() = Along(n[7] * kKnotMPerS, azimuth_deg);
    begin.P = Eigen::Matrix4d::Identity();
    map::Contact target({.source = {"reference"}, .contact = {"jord"}});
    target.Append(begin, map::DefaultContactClasses());
    const map::TimedPlace path[] = {
        {own_at(tcpa_s - 600), begin_time},
        {own_at(tcpa_s), begin_time + kTenMinutes},
        {own_at(tcpa_s + 600), begin_time + 2 * kTenMinutes}};
    const auto approach = map::ClosestApproach(
        target, map::DefaultContactClasses(), path, {.within_m = 100});
    if (approach.has_value()) {
      error.time_s =
          std::fabs(ToSeconds(approach->time - begin_time - kTenMinutes));
      error.distance_m = std::fabs(approach->distance_m - n[9]);
    } else {
      error.time_s = error.distance_m = std::numeric_limits<double>::infinity();
    }
    errors.push_back(error);
  }
  return errors;
}

}  // namespace fathom::testing
