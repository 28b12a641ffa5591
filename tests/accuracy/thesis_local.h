// Nervegna 2002, section 6.1.1 and fig. 6-1: the error of a row of local cells
// after several updates against three of the deviations that they state, on
// real relief.

#ifndef FATHOM_TESTS_ACCURACY_THESIS_LOCAL_H_
#define FATHOM_TESTS_ACCURACY_THESIS_LOCAL_H_

#include <nlohmann/json.hpp>
#include <string>

#include "tests/accuracy/terrain.h"

namespace fathom::accuracy {

// 500 m x 500 m at 10 m cells, five soundings of 0.3 m in each: for the
// thesis's estimator and for ours the share of cells whose mean depth lies
// within 3 stated deviations of the estimate, the rmse and the worst, `seeds`
// windows.
nlohmann::json ThesisLocalFigures(const Terrain& terrain, int seeds);

// Draws the middle row of the first window. False: there is no such window, or
// it cannot be written.
bool DrawThesisLocal(const Terrain& terrain, const std::string& path);

}  // namespace fathom::accuracy

#endif  // FATHOM_TESTS_ACCURACY_THESIS_LOCAL_H_
