// The past between reports: smoothed, against the batch solution.

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <random>
#include <vector>

#include "map/contacts/contact_map.h"
#include "map/geodesy/ned_frame.h"
#include "tests/map/contacts/contact_testing.h"

namespace fathom::map {
namespace {

// The posterior of all states of a track at once, by inverting the joint
// information matrix: prior of the first velocity, motion, positions.
struct Batch {
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;
};

Batch Solve(const std::vector<double>& times_s,
            const std::vector<PositionMeasurement>& seen,  // R = 0: none.
            double q, double velocity_std) {
  const auto n = static_cast<Eigen::Index>(4 * times_s.size());
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(n, n);
  Eigen::VectorXd vector = Eigen::VectorXd::Zero(n);
  information(2, 2) = information(3, 3) = 1 / (velocity_std * velocity_std);
  for (std::size_t i = 0; i < times_s.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(4 * i);
    if (seen[i].R(0, 0) > 0) {
      const Eigen::Matrix2d inverse = seen[i].R.inverse();
      information.block<2, 2>(at, at) += inverse;
      vector.segment<2>(at) += inverse * seen[i].z;
    }
    if (i == 0) continue;
    const double T = times_s[i] - times_s[i - 1];
    Eigen::Matrix4d F = Eigen::Matrix4d::Identity();
    F(0, 2) = F(1, 3) = T;
    Eigen::Matrix4d Q = Eigen::Matrix4d::Zero();
    for (int axis = 0; axis < 2; ++axis) {
      Q(axis, axis) = q * T * T * T / 3;
      Q(axis, axis + 2) = Q(axis + 2, axis) = q * T * T / 2;
      Q(axis + 2, axis + 2) = q * T;
    }
    const Eigen::Matrix4d inverse = Q.inverse();
    information.block<4, 4>(at, at) += inverse;
    information.block<4, 4>(at - 4, at - 4) += F.transpose() * inverse * F;
    information.block<4, 4>(at, at - 4) -= inverse * F;
    information.block<4, 4>(at - 4, at) -= F.transpose() * inverse;
  }
  const Eigen::MatrixXd covariance = information.inverse();
  return {.mean = covariance * vector, .covariance = covariance};
}

TEST(Smoothing, PastIsTheBatchSolution) {
  // Reports at uneven times; asked between two of them and at one.
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  ContactMap map(ContactMapOptions{.filter = FilterKind::kPerAxis});
  const std::vector<double> reported_s = {0, 7, 19, 20, 41, 60};
  for (const double asked_s : {7.0, 13.0, 33.0, 59.0}) {
    ContactMap fresh(map.options());
    std::vector<double> times_s = reported_s;
    if (asked_s != 7.0) times_s.push_back(asked_s);
    std::sort(times_s.begin(), times_s.end());
    std::vector<PositionMeasurement> seen;
    GeodeticPoint origin;
    for (const double at_s : times_s) {
      PositionMeasurement one;
      if (std::find(reported_s.begin(), reported_s.end(), at_s) !=
          reported_s.end()) {
        // Due north, so that the thesis's conversion has R = diag(20^2,
        // (r 1 degree)^2) and the axes are apart.
        const double range_m = 500 + 2 * at_s + 10 * normal(random);
        const ContactReport report = Heard("a", at_s, kBay, range_m, 0);
        const ContactEstimate estimate = *fresh.Apply(report).estimate;
        if (at_s == 0) origin = estimate.frame_origin;
        EXPECT_EQ(estimate.frame_origin, origin);
        const double across_m = range_m * 0.017453292519943295;
        const NedPoint place = NedFrame(origin).ToNed(Direct(kBay, 0, range_m));
        one.z = {place.north_m, place.east_m};
        one.R << 400, 0, 0, across_m * across_m;
      }
      seen.push_back(one);
    }
    const double q = DefaultContactClasses()[3].process_noise_m2_s3;
    const Batch batch = Solve(times_s, seen, q, 8);
    const auto at = static_cast<Eigen::Index>(
        4 *
        (std::find(times_s.begin(), times_s.end(), asked_s) - times_s.begin()));
    const ContactEstimate past = *fresh.View().At(Key("a"), AtS(asked_s));
    EXPECT_LT((past.x - batch.mean.segment<4>(at)).norm(), 1e-4) << asked_s;
    EXPECT_LT((past.P - batch.covariance.block<4, 4>(at, at)).norm(),
              1e-6 * past.P.norm())
        << asked_s;
  }
}

TEST(Smoothing, IsSurerThanWhatWasKnownThen) {
  ContactMap map(ContactMapOptions{});
  map.Apply(Heard("a", 0, kBay, 1000, 0));
  const ContactEstimate then = *map.View().At(Key("a"), AtS(20));
  map.Apply(Heard("a", 60, kBay, 1300, 0));
  const ContactEstimate now = *map.View().At(Key("a"), AtS(20));
  // 8 m/s after 20 s: 160 m; between two places 20 m sure: less than 25 m.
  EXPECT_GT(then.P(0, 0), 160 * 160);
  EXPECT_LT(now.P(0, 0), 25 * 25);
  EXPECT_NEAR(DistanceM(now.Position(), kBay), 1100, 5);
  EXPECT_EQ(now.time, AtS(20));
  EXPECT_EQ(now.report_time, AtS(0));
}

TEST(Smoothing, FollowsFixesOnPlanesOfTheirOwn) {
  // Each fix lays its own plane. 5 m/s north throughout, told every 60 s.
  ContactMap map(ContactMapOptions{});
  for (int i = 0; i < 20; ++i) {
    map.Apply(Fix("a", 60 * i, Direct(kBay, 0, 300.0 * i), 5, 0));
  }
  const ContactsView view = map.View();
  for (double t = 0; t < 1140; t += 17) {
    const ContactEstimate past = *view.At(Key("a"), AtS(t));
    EXPECT_LT(DistanceM(past.Position(), Direct(kBay, 0, 5 * t)), 0.01) << t;
    // From either side alone 343 in the middle and 1144 at the other end.
    EXPECT_LT(past.P(0, 0), 300) << t;
  }
}

TEST(Smoothing, DoesNotReachIntoAnotherLife) {
  ContactMap map(ContactMapOptions{});
  map.Apply(Fix("a", 0, kBay, 5, 0));
  map.Drop(Key("a"), AtS(60));
  map.Apply(Fix("a", 100, Direct(kBay, 90, 700), 0, 3));
  const ContactsView view = map.View();
  EXPECT_FALSE(view.At(Key("a"), AtS(-1)).has_value());
  // 50 s on from the first: 250 m north, as it was foretold.
  EXPECT_EQ(view.At(Key("a"), AtS(50))->x, Eigen::Vector4d(250, 0, 5, 0));
  // 10^2 + 50^2 * 0.5^2 + 2e-3 * 50^3 / 3 = 100 + 625 + 83.33.
  EXPECT_NEAR(view.At(Key("a"), AtS(50))->P(0, 0), 808.333333333333, 1e-9);
  EXPECT_FALSE(view.At(Key("a"), AtS(80)).has_value());
  EXPECT_EQ(view.At(Key("a"), AtS(100))->x(3), 3);
}

TEST(Smoothing, GrowsSurerWithWhatComesLaterOnly) {
  // Smoothed covariances never exceed the filter's, over random tracks.
  std::mt19937_64 random(8);
  std::uniform_real_distribution<double> unit(0, 1);
  for (int track = 0; track < 50; ++track) {
    ContactMap map(ContactMapOptions{});
    for (int i = 0; i < 30; ++i) {
      map.Apply(Heard("a", 5.0 * i + 4 * unit(random), kBay,
                      1000 + 20 * unit(random), 3 * unit(random)));
    }
    const ContactsView view = map.View();
    const TrackHistory& history = view.Find(Key("a"))->history();
    for (std::size_t i = 0; i < history.size(); ++i) {
      const ContactEstimate past = *view.At(Key("a"), history[i].time);
      const Eigen::Matrix4d less = history[i].P - past.P;
      EXPECT_GT(Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d>(past.P)
                    .eigenvalues()
                    .minCoeff(),
                0);
      EXPECT_GT(Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d>(less)
                    .eigenvalues()
                    .minCoeff(),
                -1e-6);
    }
  }
}

}  // namespace
}  // namespace fathom::map
