// The figures of the dynamic map: tracks against truth. As with figures.h the
// same seeds give the same figures.

#ifndef FATHOM_TESTS_ACCURACY_CONTACTS_H_
#define FATHOM_TESTS_ACCURACY_CONTACTS_H_

#include <nlohmann/json.hpp>
#include <string>

namespace fathom::accuracy {

// Ten times 100 runs of a vessel that moves as its class says, heard every 10 s
// from a vehicle under way, near (1 km) and far (10 km), at 1, 2 and 4 times
// the noise: mean NEES (4 states) and NIS with the share of instants inside
// their chi-square bounds, rmse of the position of both filters, reports gated.
nlohmann::json ContactConsistencyFigures();

// 300 runs of the same, at two instants: rmse of the position of both filters
// beside that of the posterior's mean (contact_optimum.h), which no estimator
// can be below.
nlohmann::json ContactOptimumFigures();

// The same tracks foretold 0, 1, 5 and 10 minutes: the share of truths inside
// the ellipse of 50, 90 and 99 %.
nlohmann::json ContactPredictionFigures();

// 100 vessels heard every 2 s for 75 minutes, 1 and 10 km off: the past 1, 10
// and 60 minutes ago, before the newest 256 estimates but for the first. The
// share of truths inside the ellipse of 50, 90 and 99 %, mean NEES, rmse.
nlohmann::json ContactPastFigures();

// Nervegna 2002, section 6.2: a contact at 3.4 ft/s on 290 degrees, the
// vehicle bound towards it and then away. 100 runs at 1, 2 and 4 times the
// noise: rms errors after 1, 5, 15 and 25 minutes, shares within 3 std.
nlohmann::json ThesisContactFigures();

// Draws figs. 6-2 to 6-13 of one such run as fig_6_2.png to fig_6_13.png.
// Returns how many were written.
int DrawThesisContact(const std::string& folder);

// Converted measurements, one Kalman step, steady states, probabilities over a
// disc and closest approaches against the tables of `folder`: of each table the
// worst error, relative but where the row says otherwise, and its limit.
nlohmann::json ContactReferenceFigures(const std::string& folder);

// Recorded tracks in `folder`: radar with GPS truth (autoferry), AIS (Solent).
nlohmann::json RecordedContactFigures(const std::string& folder);

}  // namespace fathom::accuracy

#endif  // FATHOM_TESTS_ACCURACY_CONTACTS_H_
