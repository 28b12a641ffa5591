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

// The same backwards: p - T v, disturbed on the way as much.
State PredictedBack(State s, double t, double q) {
  s.north.p -= t * s.north.v;
  s.east.p -= t * s.east.v;
  s.pp += -2 * t * s.pv + t * t * s.vv + q * t * t * t / 3;
  s.pv += -t * s.vv - q * t * t / 2;
  s.vv += q * t;
  return s;
}

// What two that know nothing of each other say together: informations add.
State Together(const State& a, const State& b) {
  struct Information {
    double pp, pv, vv;
  };
  const auto inverse = [](double pp, double pv, double vv) {
    const double det = pp * vv - pv * pv;
    return Information{vv / det, -pv / det, pp / det};
  };
  const Information of_a = inverse(a.pp, a.pv, a.vv);
  const Information of_b = inverse(b.pp, b.pv, b.vv);
  const Information sum =
      inverse(of_a.pp + of_b.pp, of_a.pv + of_b.pv, of_a.vv + of_b.vv);
  const auto mean = [&](const Axis& x, const Axis& y) {
    const double p =
        of_a.pp * x.p + of_a.pv * x.v + of_b.pp * y.p + of_b.pv * y.v;
    const double v =
        of_a.pv * x.p + of_a.vv * x.v + of_b.pv * y.p + of_b.vv * y.v;
    return Axis{.p = sum.pp * p + sum.pv * v, .v = sum.pv * p + sum.vv * v};
  };
  return {.north = mean(a.north, b.north),
          .east = mean(a.east, b.east),
          .pp = sum.pp,
          .pv = sum.pv,
          .vv = sum.vv};
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
  return Together(ahead, PredictedBack(StateOf(fixes[last + 1]),
                                       fixes[last + 1].time_s - time_s, q));
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

double Square(double x) { return x * x; }

// A cell's soundings, all at once.
struct Moments {
  explicit Moments(const std::vector<Sounding>& soundings)
      : count(static_cast<double>(soundings.size())) {
    for (const Sounding& s : soundings) {
      weight += 1 / Square(s.std_m);
      mean_m += s.depth_m / Square(s.std_m);
    }
    mean_m /= weight;
    for (const Sounding& s : soundings) {
      scatter += Square((s.depth_m - mean_m) / s.std_m);
    }
  }
  double free() const { return count - 1; }
  // s_h^2, the typical stated variance.
  double stated_m2() const { return count / weight; }

  double count;
  double weight = 0;
  double mean_m = 0;
  double scatter = 0;
};

// An opinion about tau^2 and its variance; several are weighed by precision.
struct Opinion {
  double value_m2 = 0;
  double variance_m4 = 0;
};
Opinion Weighed(const std::vector<Opinion>& opinions) {
  double precision = 0;
  double sum = 0;
  for (const Opinion& opinion : opinions) {
    precision += 1 / opinion.variance_m4;
    sum += opinion.value_m2 / opinion.variance_m4;
  }
  return {sum / precision, 1 / precision};
}

// The mean of N(value, variance) cut off below 0: in units of its std
// x + phi(x) / Phi(x).
double CutOffBelowZero(const Opinion& opinion) {
  const double std_m2 = std::sqrt(opinion.variance_m4);
  const double x = opinion.value_m2 / std_m2;
  const double density =
      std::exp(-0.5 * x * x) / std::sqrt(2 * std::numbers::pi);
  return std_m2 * (x + density / Phi(x));
}

// Squared steps between measured neighbours along one axis, their noise off.
struct Steps {
  void Add(const Moments& a, const Moments& b) {
    const double noise_m2 = 1 / a.weight + 1 / b.weight;
    square_m2 += Square(a.mean_m - b.mean_m) - noise_m2;
    noise_sum_m2 += noise_m2;
    share += (1 / a.count + 1 / b.count) / 2;
    count += 1;
  }
  // The mean square, and the variance of that: twelve steps have nine ends.
  Opinion Mean() const {
    const double mean_m2 = std::max(0.0, square_m2 / count);
    return {mean_m2, 4 * Square(mean_m2 + noise_sum_m2 / count) / count};
  }
  double square_m2 = 0;
  double noise_sum_m2 = 0;
  double share = 0;
  double count = 0;
};

// tau^2 by the witnesses around a cell.
Opinion Regional(const std::array<std::optional<Moments>, 9>& cells,
                 double cell_size_m) {
  Steps north;
  Steps east;
  double free = 0;
  double excess_m2 = 0;
  double stated_m2 = 0;
  for (std::size_t k = 0; k < 9; ++k) {
    if (!cells[k].has_value()) continue;
    if (k < 6 && cells[k + 3]) north.Add(*cells[k], *cells[k + 3]);
    if (k % 3 < 2 && cells[k + 1]) east.Add(*cells[k], *cells[k + 1]);
    if (k == 4) continue;
    free += cells[k]->free();
    excess_m2 += (cells[k]->scatter - cells[k]->free()) * cells[k]->stated_m2();
    stated_m2 += cells[k]->free() * cells[k]->stated_m2();
  }
  // A plane of 0.03 varies by (0.03 cell)^2 / 12 inside a cell.
  const double typical_m2 = Square(0.03 * cell_size_m) / 12;
  std::optional<Opinion> steps;
  if (north.count + east.count > 0) {
    const Opinion up = (north.count > 0 ? north : east).Mean();
    const Opinion right = (east.count > 0 ? east : north).Mean();
    const double part =
        1 / (12 + 4 * (north.share + east.share) / (north.count + east.count));
    steps = {(up.value_m2 + right.value_m2) * part,
             (up.variance_m4 + right.variance_m4) * part * part};
  }
  const double scale_m2 = 1e-4 + (steps ? steps->value_m2 : typical_m2);
  std::vector<Opinion> opinions = {
      {std::min(typical_m2, 1.6 * scale_m2), Square(1.6 * scale_m2)}};
  if (steps) {
    opinions.push_back(
        {steps->value_m2, steps->variance_m4 + Square(0.4 * scale_m2)});
  }
  if (free > 0) {
    opinions.push_back(
        {excess_m2 / free, 2 * Square(scale_m2 + stated_m2 / free) / free +
                               Square(0.6 * scale_m2)});
  }
  return Weighed(opinions);
}

// tau^2 of a cell, its own scatter heard too.
double Variability(const Moments& own, const Opinion& region) {
  if (own.free() < 1) return CutOffBelowZero(region);
  const double own_m2 =
      (own.scatter - own.free()) * own.stated_m2() / own.free();
  const double expected_m2 =
      std::max(region.value_m2, 0.8 * std::sqrt(region.variance_m4));
  const double shrunk_m2 = CutOffBelowZero(Weighed(
      {region,
       {own_m2, 2 * Square(own.stated_m2() + expected_m2) / own.free()}}));
  // In std of a chi-square: what is beyond two to four stands by itself.
  const double deviation =
      (own.scatter - own.free()) / std::sqrt(2 * own.free());
  const double stands = std::clamp((deviation - 2) / 2, 0.0, 1.0);
  return shrunk_m2 + stands * std::max(0.0, own_m2 - shrunk_m2);
}

// map/local/hazard.h: the shoalest credible sounding (IHO S-44 order 2), where
// the stated noise does not explain it.
std::optional<double> HazardOf(const std::vector<Sounding>& soundings,
                               const Moments& own) {
  std::optional<double> shoalest_m;
  for (const Sounding& s : soundings) {
    if (Square(1.96 * s.std_m) > 1 + Square(0.023 * s.depth_m)) continue;
    shoalest_m = std::min(shoalest_m.value_or(s.depth_m), s.depth_m);
  }
  // Of one sounding both are the same, but for rounding.
  constexpr double kRoundingM = 1e-9;
  if (!shoalest_m.has_value() || *shoalest_m > own.mean_m + kRoundingM) {
    return std::nullopt;
  }
  const double stated_m = std::sqrt(own.stated_m2());
  const double above_m = (own.mean_m - *shoalest_m) * own.count / own.free();
  const double bound = std::sqrt(2 * std::log(50 * own.count)) - 0.45;
  if (own.count > 2 && above_m <= bound * stated_m) return std::nullopt;
  return *shoalest_m - 4.5 * stated_m;
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

Seabed ReadAdaptive(const Around& cells, const std::optional<Depth>& prior,
                    double cell_size_m) {
  std::array<std::optional<Moments>, 9> moments;
  for (std::size_t k = 0; k < cells.size(); ++k) {
    if (cells[k] != nullptr) moments[k].emplace(*cells[k]);
  }
  const Moments& own = *moments[4];
  const double tau2_m2 = Variability(own, Regional(moments, cell_size_m));
  double mean_m = own.mean_m;
  double variance_m2 = 1 / own.weight + tau2_m2 / own.count;
  if (prior.has_value()) {
    // A prior that is contradicted is widened to the contradiction (4.18, 4.20
    // then); a single sounding beyond three sigma may itself be the error.
    const double apart2_m2 = Square(mean_m - prior->mean_m);
    const double evidence_m2 = variance_m2;
    const double prior_m2 =
        std::max(prior->variance_m2, apart2_m2 - evidence_m2);
    const double k = prior_m2 / (prior_m2 + evidence_m2);
    mean_m = prior->mean_m + k * (mean_m - prior->mean_m);
    variance_m2 = (1 - k) * prior_m2;
    if (own.count == 1 && apart2_m2 > 9 * (prior->variance_m2 + evidence_m2)) {
      const double stated =
          prior->variance_m2 / (prior->variance_m2 + evidence_m2);
      variance_m2 += stated * (1 - stated) * apart2_m2;
    }
  }
  Seabed seabed{.known = true,
                .depth = {.mean_m = mean_m,
                          .variance_m2 = variance_m2 + tau2_m2,
                          .measured_s = cells[4]->front().time_s},
                .hazard_m = HazardOf(*cells[4], own)};
  for (const Sounding& s : *cells[4]) {
    seabed.depth.measured_s = std::max(*seabed.depth.measured_s, s.time_s);
  }
  return seabed;
}

std::optional<Place> PlaceOf(const Track& track, double time_s) {
  const std::optional<State> state = At(track, time_s);
  if (!state.has_value()) return std::nullopt;
  return Place{.north_m = state->north.p,
               .east_m = state->east.p,
               .variance_m2 = state->pp};
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
    if (seabed.hazard_m.has_value()) {
      expected.into_hazard_m =
          question.depth_m + question.clearance_m - *seabed.hazard_m;
      // The share of the cell that the hazard is taken to fill.
      if (*expected.into_hazard_m >= 0) fixed = std::max(fixed, 0.06);
    }
  }
  expected.probability = 1 - (1 - fixed) * free;
  return expected;
}

}  // namespace fathom::oracle
