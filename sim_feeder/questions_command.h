// `fathom-feeder questions`: fixed questions about a survey, as CSV for
// `fathom query --points-file`: places in and a little around the area, depths
// from the surface to below the seabed, times before, in and after the run.

#ifndef FATHOM_SIM_FEEDER_QUESTIONS_COMMAND_H_
#define FATHOM_SIM_FEEDER_QUESTIONS_COMMAND_H_

#include <cstdint>
#include <string>

#include "absl/status/statusor.h"
#include "sim_feeder/survey_record.h"

namespace fathom::feeder {

// Lines "latitude_deg,longitude_deg,depth_m,time", a header first. The same
// record, seed and count give the same text. Errors: INVALID_ARGUMENT for a
// count outside 1 to 1 M.
absl::StatusOr<std::string> MakeQuestions(const SurveyRecord& survey,
                                          std::uint64_t seed,
                                          std::uint64_t count);

}  // namespace fathom::feeder

#endif  // FATHOM_SIM_FEEDER_QUESTIONS_COMMAND_H_
