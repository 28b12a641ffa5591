// The probability that a bivariate normal lies in a disc: how sure it is that
// a contact, known to N(mean, covariance), covers a place.

#ifndef FATHOM_MAP_QUERY_DISC_PROBABILITY_H_
#define FATHOM_MAP_QUERY_DISC_PROBABILITY_H_

#include <Eigen/Core>

namespace fathom::map {

// P(|X| <= radius_m) for X ~ N(offset_m, covariance_m2).
//
// offset_m: from the disc's centre to the mean, [n, e] metres.
// covariance_m2: 2x2, symmetric, positive semidefinite. A standard deviation
// below 1e-4 of the radius is taken as that: the edge is no sharper.
// radius_m >= 0; 0 gives 0.
//
// Relative error <= 1e-6 where the result is >= 1e-12, absolute error <= 1e-18
// below. Result in [0, 1]. NaN if an argument is not finite. Isotropic check:
// 1 - Q1(d/s, R/s), Marcum's Q. Cost about 1 us (more
// only where the radius is hundreds of standard deviations). Thread-safe.
double DiscProbability(const Eigen::Vector2d& offset_m,
                       const Eigen::Matrix2d& covariance_m2, double radius_m);

// The standard normal distribution function; relative error 1e-14 in the
// lower tail. NormalCdf(-inf) = 0, NormalCdf(+inf) = 1.
double NormalCdf(double x);

// P(low <= X <= high) for standard normal X, without cancellation when both
// lie in one tail. 0 if high <= low.
double NormalInterval(double low, double high);

}  // namespace fathom::map

#endif  // FATHOM_MAP_QUERY_DISC_PROBABILITY_H_
