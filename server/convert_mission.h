// Activities, charts and the mission's status between the wire and the map.
// Pure functions; thread-safe.

#ifndef FATHOM_SERVER_CONVERT_MISSION_H_
#define FATHOM_SERVER_CONVERT_MISSION_H_

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "base/time.h"
#include "fathom/v1/mission_service.pb.h"
#include "map/global/raster_block.h"
#include "map/obstacle_map/events.h"
#include "map/obstacle_map/obstacle_map.h"
#include "map/obstacle_map/obstacle_map_view.h"
#include "server/field_path.h"

namespace fathom::server {

// The activity to open; `now` where time is absent.
absl::StatusOr<map::StartActivity> ConvertStart(
    const v1::StartActivityRequest& request, Time now);

// The track to close; `now` where time is absent.
absl::StatusOr<map::DropContact> ConvertDrop(
    const v1::DropContactRequest& request, Time now);

// What a chart's header says of all its tiles.
struct ChartHeader {
  std::string name;
  uint32_t time_s = 0;
  bool replace = false;
  // Empty: not remembered.
  std::string import_id = {};
  // Number of the first tile, >= 1.
  uint64_t first_tile = 1;
};
absl::StatusOr<ChartHeader> ConvertHeader(const v1::PriorHeader& header,
                                          const FieldPath& path);

// One tile of the chart. Every number is checked: O(cells).
absl::StatusOr<map::RasterBlock> ConvertTile(const v1::DepthTile& tile,
                                             const ChartHeader& header,
                                             const FieldPath& path);

void WriteTransfer(const map::TransferResult& result, double duration_s,
                   v1::TransferSummary* out);
void WriteActivity(const map::ActivityView& activity, v1::ActivityStatus* out);
// Open activities first, then the ended ones, newest first; bounded.
void WriteActivities(
    const map::ObstacleMapView& view,
    google::protobuf::RepeatedPtrField<v1::ActivityStatus>* out);
void WriteContactClasses(const map::ContactClassTable& classes,
                         v1::ContactListStatus* out);
// Every limit of limits.h that a client can meet.
void WriteLimits(v1::Limits* out);

}  // namespace fathom::server

#endif  // FATHOM_SERVER_CONVERT_MISSION_H_
