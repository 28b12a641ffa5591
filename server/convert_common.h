// Conversions that every service needs: places, times, counts, stamps.
// Domain values are valid, so writing them never fails.

#ifndef FATHOM_SERVER_CONVERT_COMMON_H_
#define FATHOM_SERVER_CONVERT_COMMON_H_

#include "base/time.h"
#include "fathom/v1/types.pb.h"
#include "google/protobuf/repeated_field.h"
#include "google/protobuf/timestamp.pb.h"
#include "map/contacts/contact.h"
#include "map/geodesy/ping.h"
#include "map/geodesy/points.h"
#include "map/obstacle_map/obstacle_map_view.h"

namespace fathom::server {

void WriteTime(Time time, google::protobuf::Timestamp* out);
void WritePoint(const map::GeodeticPoint& point, v1::GeodeticPoint* out);
// Revision and time of the newest evidence; as_of stays absent in an empty
// map.
void WriteStamp(const map::ObstacleMapView& view, v1::MapStamp* out);
// One entry for each reason that occurred.
void WriteRejects(const map::RejectCounts& counts,
                  google::protobuf::RepeatedPtrField<v1::RejectCount>* out);
// The names of a contact beside the one that is told first.
void WriteNames(const std::vector<map::ContactKey>& names,
                google::protobuf::RepeatedPtrField<v1::ContactName>* out);
// The contact's estimate, its covariance as the upper triangle of
// [n e vn ve] about its own position.
void WriteContact(const map::ContactEstimate& estimate,
                  v1::ContactEstimate* out);

}  // namespace fathom::server

#endif  // FATHOM_SERVER_CONVERT_COMMON_H_
