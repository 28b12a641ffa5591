// Time of the contract (google.protobuf.Timestamp, nanoseconds) to and from
// ours (base/time.h, microseconds). Thread-safe.

#ifndef FATHOM_CLIENT_PROTO_TIME_H_
#define FATHOM_CLIENT_PROTO_TIME_H_

#include <google/protobuf/timestamp.pb.h>

#include "base/time.h"

namespace fathom::client {

// Exact.
google::protobuf::Timestamp ToProto(Time time);

// Nanoseconds below a microsecond are cut off towards the past.
Time FromProto(const google::protobuf::Timestamp& time);

}  // namespace fathom::client

#endif  // FATHOM_CLIENT_PROTO_TIME_H_
