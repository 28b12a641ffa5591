// The tracks of contacts over the area: true ways, estimates and their 95 %
// ellipses.

#ifndef FATHOM_SIM_FEEDER_TRACK_PICTURE_H_
#define FATHOM_SIM_FEEDER_TRACK_PICTURE_H_

#include <string>

#include "absl/status/status.h"
#include "sim_feeder/evaluate_command.h"

namespace fathom::feeder {

// Writes a PNG, 800 x 860, north up, one scale for both axes; it covers the
// true ways and a tenth more. Ellipses: the last of each ship, and up to 20
// ships every tenth. Errors: INVALID_ARGUMENT (cannot write there). REQUIRES:
// contacts.tracks is not empty.
absl::Status DrawTracks(const std::string& path, const std::string& title,
                        const ContactEvaluation& contacts);

}  // namespace fathom::feeder

#endif  // FATHOM_SIM_FEEDER_TRACK_PICTURE_H_
