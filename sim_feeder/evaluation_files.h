// An evaluation as files, for those who would rather look than read:
//
//   evaluation.json  EvaluationJson
//   places.csv       every place asked that has a truth: where, truth, the
//                    map's mean, std and kind of evidence
//   tracks.csv       where there are contacts: each estimate with its
//                    covariance, and the truth
//   tracks.png       the same over the area (track_picture.h)
//   evaluation.png   error of the map's depth over the area; stated against
//                    observed probability; errors in stated deviations beside
//                    the normal curve

#ifndef FATHOM_SIM_FEEDER_EVALUATION_FILES_H_
#define FATHOM_SIM_FEEDER_EVALUATION_FILES_H_

#include <string>

#include "absl/status/status.h"
#include "sim_feeder/evaluate_command.h"
#include "sim_feeder/survey_area.h"

namespace fathom::feeder {

// Writes them into `folder`, which is made. `depth` must hold its places.
// Errors: PERMISSION_DENIED naming the file.
absl::Status WriteEvaluation(const std::string& folder,
                             const std::string& title, const SurveyArea& area,
                             const DepthEvaluation& depth,
                             const ContactEvaluation& contacts);

}  // namespace fathom::feeder

#endif  // FATHOM_SIM_FEEDER_EVALUATION_FILES_H_
