// The dynamic map against the numbers of the shared reference folder, for the
// unit tests that hold each row to its limit and for tests/accuracy, which
// prints them. Each function returns nothing where its file is absent.
//
// Beside the tables two sums for the probability over a disc that share
// nothing with the code under test, for what the tables do not hold: the tail
// down to 1e-12.

#ifndef FATHOM_TESTS_TESTING_CONTACT_REFERENCE_H_
#define FATHOM_TESTS_TESTING_CONTACT_REFERENCE_H_

#include <Eigen/Core>
#include <string>
#include <vector>

#include "map/contacts/filter.h"

namespace fathom::testing {

// By how much one row was missed; the function says in what.
struct ReferenceError {
  std::string row;
  double error = 0;
};
using ReferenceErrors = std::vector<ReferenceError>;

// nrl_reference_octave.txt: the place in parts of the range or the covariance
// in parts of its trace, whichever is more. kFourState: modified unbiased;
// kPerAxis: plain. (The table's covariances were formed as differences of r^2,
// which leaves 1e-15 r^2 of rounding.)
ReferenceErrors ConversionErrors(const std::string& folder,
                                 map::FilterKind kind);

// stonesoup_reference.txt: one prediction's noise, one update's state,
// covariance (norms of the differences) and NIS.
ReferenceErrors KalmanStepErrors(const std::string& folder);

// steady_state_alpha_beta.csv, the rows of white acceleration: gains and
// covariance after 2000 steps, relative.
ReferenceErrors SteadyStateErrors(const std::string& folder,
                                  map::FilterKind kind);

// A disc about the origin and a normal's mean and covariance.
struct DiscCase {
  std::string row;
  Eigen::Vector2d offset_m;
  Eigen::Matrix2d covariance_m2;
  double radius_m = 0;
  // What it should be.
  double probability = 0;
  // The same as published, with the half of its last digit; 0: not published.
  double printed = 0;
  double printed_within = 0;
};

// disc_probability_published.csv and isotropic_disk_probability.csv.
std::vector<DiscCase> PublishedDiscs(const std::string& folder);
std::vector<DiscCase> IsotropicDiscs(const std::string& folder);

// Seeded cases, those of P >= 1e-12 of `count`, with what the sums below say.
std::vector<DiscCase> SummedIsotropicDiscs(int count);
std::vector<DiscCase> SummedEllipticDiscs(int count);

// The isotropic case as a series of positive terms (noncentral chi-square):
// sum over k of Poisson(k; d^2 / 2 s^2) P(Poisson(R^2 / 2 s^2) > k).
double IsotropicSeries(double d, double s, double radius);

// Any case, by thousands of chords across the *major* axis in long double (the
// code under test takes few, along the minor one). p along the major axis.
double ManyChords(double p, double q, double major, double minor,
                  double radius);

// DiscProbability's relative error of the case.
double RelativeError(const DiscCase& one);

// cpa_encounters.csv: range, bearing and both speeds of designed encounters
// with the TCPA and the distance computed elsewhere; the target's course is not
// told: one course must give both. In parts of what the table's rounding
// leaves, 0.001 minute and 0.2 m (bearings are told to 0.001 degree, half of
// which is 0.13 m at 14.8 km).
ReferenceErrors EncounterErrors(const std::string& folder);

// jord_cpa.csv: two on great circles of a sphere, taken up ten minutes before
// their CPA. Ours are on the ellipsoid, so some is missed by right.
struct SphereError {
  double time_s = 0;
  double distance_m = 0;
  // By how much the table's own places are off the way laid here, degrees.
  double place_deg = 0;
};
std::vector<SphereError> SphereEncounterErrors(const std::string& folder);

}  // namespace fathom::testing

#endif  // FATHOM_TESTS_TESTING_CONTACT_REFERENCE_H_
