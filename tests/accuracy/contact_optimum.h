// The best that can be known of a contact: the mean of its posterior, which no
// estimator's mean square error is below.

#ifndef FATHOM_TESTS_ACCURACY_CONTACT_OPTIMUM_H_
#define FATHOM_TESTS_ACCURACY_CONTACT_OPTIMUM_H_

#include <Eigen/Core>
#include <cstdint>
#include <span>

#include "tests/accuracy/contact_runs.h"

namespace fathom::accuracy {

struct PosteriorMean {
  // [n, e, vn, ve] at the last moment, metres and m/s, in the runs' plane.
  Eigen::Vector4d x;
  // Samples that the weighted ones are worth (Kong 1992): the error of x adds
  // 1 / effective_samples of the posterior's variance.
  double effective_samples = 0;
};

// E[x_n | reports of moments 0..n] under what drew them: position unknown
// before the first report, velocity by encounter.velocity_std_m_s about
// encounter.contact's, white accelerations, range and bearing as reported,
// without a filter's linearisation. By importance sampling of whole tracks:
// `samples` are drawn from the Gaussian at the posterior's mode (Gauss-Newton,
// in information form) and weighed by the true posterior over it. REQUIRES: at
// least two moments, samples even. 10 ms for 60 moments and 1000 samples.
PosteriorMean MeanOfPosterior(const Encounter& encounter,
                              std::span<const Moment> moments, int samples,
                              std::uint64_t seed);

}  // namespace fathom::accuracy

#endif  // FATHOM_TESTS_ACCURACY_CONTACT_OPTIMUM_H_
