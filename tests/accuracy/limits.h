// What the accuracy figures must be: the limits, checked.

#ifndef FATHOM_TESTS_ACCURACY_LIMITS_H_
#define FATHOM_TESTS_ACCURACY_LIMITS_H_

#include <nlohmann/json.hpp>

namespace fathom::accuracy {

// Prints one line for each limit that `report` has the figures for, "ok" or
// "MISSED" with the worst figure and where it stands, and returns how many
// were missed.
int CheckLimits(const nlohmann::json& report);
// The same of the contacts' figures.
int CheckContactLimits(const nlohmann::json& report);

}  // namespace fathom::accuracy

#endif  // FATHOM_TESTS_ACCURACY_LIMITS_H_
