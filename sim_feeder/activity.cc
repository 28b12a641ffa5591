#include "sim_feeder/activity.h"

#include <cstdio>
#include <vector>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "client/proto_time.h"
#include "sim_feeder/message_sink.h"

namespace fathom::feeder {

absl::Status OpenActivity(const client::Client& client,
                          const ActivityToOpen& activity) {
  v1::StartActivityRequest request;
  request.set_activity_id(activity.id);
  request.set_vehicle_id(activity.vehicle_id);
  *request.mutable_time() = client::ToProto(activity.time);
  v1::ActivityParameters& parameters = *request.mutable_parameters();
  parameters = activity.parameters;
  parameters.mutable_south_west()->set_latitude_deg(
      activity.area.south_west.latitude_deg);
  parameters.mutable_south_west()->set_longitude_deg(
      activity.area.south_west.longitude_deg);
  parameters.set_north_extent_m(activity.area.north_extent_m);
  parameters.set_east_extent_m(activity.area.east_extent_m);
  parameters.set_cell_size_m(activity.area.cell_size_m);
  return client.StartActivity(request).status();
}

absl::Status CompleteActivity(const client::Client& client,
                              const std::string& activity_id) {
  v1::CompleteActivityRequest request;
  request.set_activity_id(activity_id);
  FATHOM_ASSIGN_OR_RETURN(const v1::CompleteActivityResponse response,
                          client.CompleteActivity(request));
  absl::FPrintF(stderr,
                "activity %s complete: %d local cells to %d global leaves\n",
                activity_id, response.transfer().local_cells(),
                response.transfer().leaves_written());
  return absl::OkStatus();
}

absl::StatusOr<ActivityCounts> CountsOf(const client::Client& client,
                                        const std::string& activity_id) {
  FATHOM_ASSIGN_OR_RETURN(const v1::GetMissionStatusResponse mission,
                          client.GetMissionStatus());
  for (const v1::ActivityStatus& activity : mission.activities()) {
    if (activity.activity_id() != activity_id) continue;
    return ActivityCounts{
        .measurements_accepted = activity.measurements_accepted(),
        .rejects = RejectCounts(std::vector<v1::RejectCount>(
            activity.rejects().begin(), activity.rejects().end()))};
  }
  return absl::NotFoundError(
      absl::StrFormat("the server has no activity \"%s\"", activity_id));
}

}  // namespace fathom::feeder
