// The normal distribution function for where it is wanted millions of times a
// second and ten digits are plenty: what the seabed says of a point.

#ifndef FATHOM_MAP_QUERY_TABULATED_NORMAL_H_
#define FATHOM_MAP_QUERY_TABULATED_NORMAL_H_

namespace fathom::map {

// As NormalCdf (map/query/disc_probability.h), a third of its cost: Taylor's
// series of six terms about the nearest of 513 tabulated places. Relative error
// 1e-10 where |x| < 8; NormalCdf itself beyond. NaN for NaN. About 8 ns.
// Thread-safe.
double TabulatedNormalCdf(double x);

}  // namespace fathom::map

#endif  // FATHOM_MAP_QUERY_TABULATED_NORMAL_H_
