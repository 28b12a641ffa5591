// Opening, counting and completing the activity that a run's pings belong to.

#ifndef FATHOM_SIM_FEEDER_ACTIVITY_H_
#define FATHOM_SIM_FEEDER_ACTIVITY_H_

#include <cstdint>
#include <map>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "base/time.h"
#include "client/client.h"
#include "fathom/v1/mission_service.pb.h"
#include "sim_feeder/survey_area.h"

namespace fathom::feeder {

struct ActivityToOpen {
  std::string id = {};
  // Empty: any.
  std::string vehicle_id = {};
  Time time = {};
  SurveyArea area;
  // Everything but the area.
  v1::ActivityParameters parameters = {};
};

// Errors: the server's.
absl::Status OpenActivity(const client::Client& client,
                          const ActivityToOpen& activity);

// Completes it, which transfers its map, and tells people the outcome on
// standard error. Errors: the server's.
absl::Status CompleteActivity(const client::Client& client,
                              const std::string& activity_id);

// What the server has counted of an activity, over all links and restarts.
struct ActivityCounts {
  std::uint64_t measurements_accepted = 0;
  // By reason, as RejectCounts.
  std::map<std::string, std::uint64_t> rejects = {};
};

// Errors: NOT_FOUND, and the server's.
absl::StatusOr<ActivityCounts> CountsOf(const client::Client& client,
                                        const std::string& activity_id);

}  // namespace fathom::feeder

#endif  // FATHOM_SIM_FEEDER_ACTIVITY_H_
