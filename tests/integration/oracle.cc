#include "tests/integration/oracle.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>

namespace fathom::oracle {
namespace {

double Phi(double x) { return 0.5 * std::erfc(-x / std::numbers::sqrt2); }

// Position and velocity along one axis: means, and their covariance, which is
// the same on both axes.
struct Axis {
  double p = 0;
  double v = 0;
};
struct State {
  Axis north;
  Axis east;
  double pp = 0;
  double pv = 0;
  double vv = 0;
};

State StateOf(const Fix& fix) {
  return {.north = {.p = fix.north_m, .v = fix.velocity_north_m_s},
          .east = {.p = fix.east_m, .v = fix.velocity_east_m_s},
          .pp = fix.position_std_m * fix.position_std_m,
          .pv = 0,
          .vv = fix.velocity_std_m_s * fix.velocity_std_m_s};
}

// Eqs. 5.19-5.23 over T seconds.
State Predicted(State s, double t, double q) {
  s.north.p += t * s.north.v;
  s.east.p += t * s.east.v;
  s.pp += 2 * t * s.pv + t * t * s.vv + q * t * t * t / 3;
  s.pv += t * s.vv + q * t * t / 2;
  s.vv += q * t;
  return s;
}

// `here`, knowing `later` T seconds on. G = P F' (P of the prediction)^-1.
State Smoothed(const State& here, double t, double q, const State& later) {
  const State ahead = Predicted(here, t, q);
  // P F' with F = [1 T; 0 1].
  const double a = here.pp + t * here.pv;
  const double b = here.pv;
  const double c = here.pv + t * here.vv;
  const double d = here.vv;
  const double det = ahead.pp * ahead.vv - ahead.pv * ahead.pv;
  const double g11 = (a * ahead.vv - b * ahead.pv) / det;
  const double g12 = (b * ahead.pp - a * ahead.pv) / det;
  const double g21 = (c * ahead.vv - d * ahead.pv) / det;
  const double g22 = (d * ahead.pp - c * ahead.pv) / det;
  State s = here;
  const auto move = [&](Axis& axis, const Axis& from, const Axis& to) {
    axis.p += g11 * (to.p - from.p) + g12 * (to.v - from.v);
    axis.v += g21 * (to.p - from.p) + g22 * (to.v - from.v);
  };
  move(s.north, ahead.north, later.north);
  move(s.east, ahead.east, later.east);
  // P + G (P of later - P of the prediction) G'.
  const double e = later.pp - ahead.pp;
  const double f = later.pv - ahead.pv;
  const double h = later.vv - ahead.vv;
  s.pp += g11 * (e * g11 + f * g12) + g12 * (f * g11 + h * g12);
  s.pv += g11 * (e * g21 + f * g22) + g12 * (f * g21 + h * g22);
  s.vv += g21 * (e * g21 + f * g22) + g22 * (f * g21 + h * g22);
  return s;
}

// The track at a time; absent before its first fix.
std::optional<State> At(const Track& track, double time_s) {
  const std::vector<Fix>& fixes = track.fixes;
  if (time_s < fixes.front().time_s) return std::nullopt;
  std::size_t last = 0;
  while (last + 1 < fixes.size() && fixes[last + 1].time_s <= time_s) ++last;
  const double q = track.process_noise_m2_s3;
  const State ahead =
      Predicted(StateOf(fixes[last]), time_s - fixes[last].time_s, q);
  if (last + 1 == fixes.size()) return ahead;
  State later = StateOf(fixes.back());
  for (std::size_t i = fixes.size() - 1; i > last + 1; --i) {
    later = Smoothed(StateOf(fixes[i - 1]),
                     fixes[i].time_s - fixes[i - 1].time_s, q, later);
  }
  return Smoothed(ahead, fixes[last + 1].time_s - time_s, q, later);
}

// P(|X| <= radius) of N((north, east), s^2 I): over north, put as radius
// sin(a) so that the ends are smooth, the exact chord along east. 400 steps of
// the midpoint rule: its error falls faster than any power; below 1e-9 while
// radius < 40 s, which the scene keeps.
double DiscProbability(double north_m, double east_m, double s,
                       double radius_m) {
  constexpr int kSteps = 400;
  double sum = 0;
  for (int i = 0; i < kSteps; ++i) {
    const double angle = std::numbers::pi * ((i + 0.5) / kSteps - 0.5);
    const double half_m = radius_m * std::cos(angle);
    const double z = (radius_m * std::sin(angle) - north_m) / s;
    sum += half_m * std::exp(-0.5 * z * z) *
           (Phi((half_m - east_m) / s) - Phi((-half_m - east_m) / s));
  }
  return sum * std::numbers::pi / kSteps /
         (s * std::sqrt(2 * std::numbers::pi));
}

double ContactProbability(const Question& question, const Track& track) {
  // From the surface down to the keel.
  if (question.depth_m - question.clearance_m > track.keel_depth_m) return 0;
  const std::optional<State> state = At(track, question.time_s);
  if (!state.has_value()) return 0;
  const double north_m = state->north.p - question.north_m;
  const double east_m = state->east.p - question.east_m;
  const double s = std::sqrt(state->pp);
  const double radius_m = track.radius_m + question.radius_m;
  // Nine sigmas off: below 1e-17.
  if (std::hypot(north_m, east_m) > radius_m + 9 * s) return 0;
  return DiscProbability(north_m, east_m, s, radius_m);
}

}  // namespace

Depth Fuse(const std::optional<Depth>& prior, double depth_m, double std_m,
           double time_s, Rule rule) {
  if (!prior.has_value()) {
    return {
        .mean_m = depth_m, .variance_m2 = std_m * std_m, .measured_s = time_s};
  }
  const double k =
      prior->variance_m2 / (prior->variance_m2 + std_m * std_m);  // 4.17
  Depth fused = *prior;
  fused.mean_m += k * (depth_m - prior->mean_m);  // 4.18
  fused.variance_m2 *= 1 - k;                     // 4.20
  if (rule == Rule::kNervegna) {                  // 4.21
    fused.variance_m2 += k * std::pow(prior->mean_m - depth_m, 2);
  }
  fused.measured_s = std::max(prior->measured_s.value_or(time_s), time_s);
  return fused;
}

Expected Answer(const Question& question, const Seabed& seabed,
                const std::vector<Track>& tracks, double ageing_m2_s) {
  Expected expected;
  double free = 1;
  for (const Track& track : tracks) {
    free *= 1 - ContactProbability(question, track);
  }
  expected.moving = 1 - free;
  double fixed = 0;
  if (seabed.land) {
    fixed = 1;
  } else if (seabed.known) {
    const double age_s =
        std::max(0.0, question.time_s -
                          seabed.depth.measured_s.value_or(question.time_s));
    fixed =
        Phi((question.depth_m + question.clearance_m - seabed.depth.mean_m) /
            std::sqrt(seabed.depth.variance_m2 + ageing_m2_s * age_s));
  }
  expected.probability = 1 - (1 - fixed) * free;
  return expected;
}

}  // namespace fathom::oracle
