// An evaluation as text: one line of JSON, or a table for people.
//
// JSON: {"points", "without_truth", "unknown", "unknown_share", "land_right",
// "land_wrong", "measured": {count, rmse_m, bias_m, mean_std_m, within_1std,
// within_2std, within_3std, nees}, "smoothed": {...}, "prior": {...},
// "obstacles": {count, near_contact, brier, calibration_error, "reliability":
// [{from, to, count, stated, observed}]}, "contacts": {count, missing, rmse_m,
// nees, within_95, "predicted": [{horizon_s, count, rmse_m, nees,
// within_95}]}}. Shares are in [0, 1].

#ifndef FATHOM_SIM_FEEDER_EVALUATION_REPORT_H_
#define FATHOM_SIM_FEEDER_EVALUATION_REPORT_H_

#include <string>

#include "sim_feeder/evaluate_command.h"

namespace fathom::feeder {

std::string EvaluationJson(const DepthEvaluation& depth,
                           const ContactEvaluation& contacts);
std::string EvaluationTable(const DepthEvaluation& depth,
                            const ContactEvaluation& contacts);

}  // namespace fathom::feeder

#endif  // FATHOM_SIM_FEEDER_EVALUATION_REPORT_H_
