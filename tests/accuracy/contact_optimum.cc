#include "tests/accuracy/contact_optimum.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <utility>
#include <variant>
#include <vector>

namespace fathom::accuracy {
namespace {

using Eigen::Matrix2d;
using Eigen::Matrix4d;
using Eigen::Vector2d;
using Eigen::Vector4d;
using Track = std::vector<Vector4d>;

constexpr int kMaxSteps = 100;
constexpr double kConvergedM = 1e-3;
// The Gaussian is drawn a little wider than the mode's, so that tails beyond it
// do not get great weights.
constexpr double kWider = 1.02;

double Wrapped(double rad) { return std::remainder(rad, 2 * std::numbers::pi); }

// The negative logarithm of the posterior of a whole track, without constants.
class Posterior {
 public:
  Posterior(const Encounter& encounter, std::span<const Moment> moments)
      : moments_(moments),
        mean_velocity_(encounter.contact.tail<2>()),
        velocity_information_(
            1 / (encounter.velocity_std_m_s * encounter.velocity_std_m_s)),
        range_std_m_(encounter.range_std_m),
        bearing_std_rad_(encounter.bearing_std_deg * std::numbers::pi / 180) {
    const double T = encounter.step_s;
    const double q = encounter.process_noise_m2_s3;
    F_.topRightCorner<2, 2>() = T * Matrix2d::Identity();
    Matrix4d Q;
    Q << T * T * T / 3 * Matrix2d::Identity(), T * T / 2 * Matrix2d::Identity(),
        T * T / 2 * Matrix2d::Identity(), T * Matrix2d::Identity();
    Q_inverse_ = (q * Q).inverse();
  }

  double Cost(const Track& track) const {
    double twice = velocity_information_ *
                   (track[0].tail<2>() - mean_velocity_).squaredNorm();
    for (std::size_t k = 0; k < track.size(); ++k) {
      const Residual at = ResidualAt(k, track[k]);
      twice += at.range * at.range + at.bearing * at.bearing;
      if (k == 0) continue;
      const Vector4d jump = track[k] - F_ * track[k - 1];
      twice += jump.dot(Q_inverse_ * jump);
    }
    return twice / 2;
  }

  // The gradient's negative and the information (Gauss-Newton: measurements
  // linear about the track), by blocks; those beside the diagonal are all
  // Coupling().
  void Linearise(const Track& track, Track& downhill,
                 std::vector<Matrix4d>& information) const {
    const std::size_t n = track.size();
    downhill.assign(n, Vector4d::Zero());
    information.assign(n, Matrix4d::Zero());
    information[0].bottomRightCorner<2, 2>() =
        velocity_information_ * Matrix2d::Identity();
    downhill[0].tail<2>() =
        velocity_information_ * (mean_velocity_ - track[0].tail<2>());
    for (std::size_t k = 0; k < n; ++k) {
      const Residual at = ResidualAt(k, track[k]);
      const Vector2d along = at.away / at.distance_m;
      const Vector2d across = {-along.y(), along.x()};
      const double across_std_m = at.distance_m * bearing_std_rad_;
      downhill[k].head<2>() +=
          at.range / range_std_m_ * along + at.bearing / across_std_m * across;
      information[k].topLeftCorner<2, 2>() +=
          along * along.transpose() / (range_std_m_ * range_std_m_) +
          across * across.transpose() / (across_std_m * across_std_m);
      if (k + 1 == n) break;
      const Vector4d pull = Q_inverse_ * (track[k + 1] - F_ * track[k]);
      downhill[k] += F_.transpose() * pull;
      downhill[k + 1] -= pull;
      information[k] += F_.transpose() * Q_inverse_ * F_;
      information[k + 1] += Q_inverse_;
    }
  }

  // The block of states k and k + 1.
  Matrix4d Coupling() const { return -F_.transpose() * Q_inverse_; }

  // A track to begin at: what was reported, at one velocity.
  Track Begin() const {
    const std::size_t n = moments_.size();
    const Vector2d first = Reported(0);
    const Vector2d last = Reported(n - 1);
    Track track(n);
    for (std::size_t k = 0; k < n; ++k) {
      const double share = static_cast<double>(k) / static_cast<double>(n - 1);
      track[k] << first + share * (last - first),
          (last - first) / (moments_.back().at_s - moments_[0].at_s);
    }
    return track;
  }

 private:
  // Over 1 sigma.
  struct Residual {
    Vector2d away;
    double distance_m;
    double range;
    double bearing;
  };

  const map::RangeBearing& Heard(std::size_t k) const {
    return std::get<map::RangeBearing>(moments_[k].report.observation);
  }
  static double Radians(double deg) { return deg * std::numbers::pi / 180; }

  Vector2d Reported(std::size_t k) const {
    const map::RangeBearing& heard = Heard(k);
    const double bearing = Radians(heard.bearing_deg);
    return moments_[k].vehicle +
           heard.range_m * Vector2d(std::cos(bearing), std::sin(bearing));
  }

  Residual ResidualAt(std::size_t k, const Vector4d& x) const {
    const map::RangeBearing& heard = Heard(k);
    const Vector2d away = x.head<2>() - moments_[k].vehicle;
    const double distance_m = away.norm();
    return {.away = away,
            .distance_m = distance_m,
            .range = (heard.range_m - distance_m) / range_std_m_,
            .bearing = Wrapped(Radians(heard.bearing_deg) -
                               std::atan2(away.y(), away.x())) /
                       bearing_std_rad_};
  }

  std::span<const Moment> moments_;
  Vector2d mean_velocity_;
  double velocity_information_;
  double range_std_m_;
  double bearing_std_rad_;
  Matrix4d F_ = Matrix4d::Identity();
  Matrix4d Q_inverse_;
};

// The information as L S L': S by its blocks, L unit lower.
class Factors {
 public:
  Factors(std::vector<Matrix4d> information, const Matrix4d& coupling) {
    for (std::size_t k = 0; k < information.size(); ++k) {
      if (k > 0) information[k] -= coupling.transpose() * up_.back();
      roots_.emplace_back(information[k]);
      up_.push_back(roots_.back().solve(coupling));
    }
  }

  // The step to the minimum of the quadratic with this information.
  Track Solve(Track downhill) const {
    for (std::size_t k = 1; k < downhill.size(); ++k) {
      downhill[k] -= up_[k - 1].transpose() * downhill[k - 1];
    }
    for (std::size_t k = downhill.size(); k-- > 0;) {
      downhill[k] = roots_[k].solve(downhill[k]).eval();
      if (k + 1 < downhill.size()) downhill[k] -= up_[k] * downhill[k + 1];
    }
    return downhill;
  }

  // Turns white noise, in place, into a draw of the covariance.
  void Colour(Track& noise) const {
    for (std::size_t k = noise.size(); k-- > 0;) {
      roots_[k].matrixU().solveInPlace(noise[k]);
      if (k + 1 < noise.size()) noise[k] -= up_[k] * noise[k + 1];
    }
  }

 private:
  std::vector<Eigen::LLT<Matrix4d>> roots_;
  // S_k^-1 coupling.
  std::vector<Matrix4d> up_;
};

Track Sum(const Track& track, double share, const Track& step) {
  Track sum(track.size());
  for (std::size_t k = 0; k < track.size(); ++k) {
    sum[k] = track[k] + share * step[k];
  }
  return sum;
}

// Gauss-Newton with halved steps, to the mode.
Track Mode(const Posterior& posterior) {
  Track track = posterior.Begin();
  Track downhill;
  std::vector<Matrix4d> information;
  for (int i = 0; i < kMaxSteps; ++i) {
    posterior.Linearise(track, downhill, information);
    const Track step =
        Factors(information, posterior.Coupling()).Solve(downhill);
    const double cost = posterior.Cost(track);
    double share = 1;
    while (share > 1e-6 && posterior.Cost(Sum(track, share, step)) > cost) {
      share /= 2;
    }
    track = Sum(track, share, step);
    double moved_m = 0;
    for (const Vector4d& x : step) {
      moved_m = std::max(moved_m, x.head<2>().norm());
    }
    if (share * moved_m < kConvergedM) break;
  }
  return track;
}

}  // namespace

PosteriorMean MeanOfPosterior(const Encounter& encounter,
                              std::span<const Moment> moments, int samples,
                              std::uint64_t seed) {
  const Posterior posterior(encounter, moments);
  const Track mode = Mode(posterior);
  Track downhill;
  std::vector<Matrix4d> information;
  posterior.Linearise(mode, downhill, information);
  const Factors factors(information, posterior.Coupling());

  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::vector<double> logs;
  std::vector<Vector4d> ends;
  Track noise(moments.size());
  for (int i = 0; i < samples / 2; ++i) {
    double square = 0;
    for (Vector4d& x : noise) {
      for (double& value : x) value = normal(random);
      square += x.squaredNorm();
    }
    factors.Colour(noise);
    // Both ways: what is odd in the noise cancels.
    for (const double sign : {kWider, -kWider}) {
      const Track track = Sum(mode, sign, noise);
      logs.push_back(square / 2 - posterior.Cost(track));
      ends.push_back(track.back());
    }
  }
  const double greatest = *std::max_element(logs.begin(), logs.end());
  PosteriorMean mean{.x = Vector4d::Zero()};
  double weights = 0;
  double squares = 0;
  for (std::size_t i = 0; i < logs.size(); ++i) {
    const double weight = std::exp(logs[i] - greatest);
    mean.x += weight * ends[i];
    weights += weight;
    squares += weight * weight;
  }
  mean.x /= weights;
  mean.effective_samples = weights * weights / squares;
  return mean;
}

}  // namespace fathom::accuracy
