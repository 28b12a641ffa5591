#include "client/proto_time.h"

#include <cstdint>

namespace fathom::client {

google::protobuf::Timestamp ToProto(Time time) {
  const auto seconds = std::chrono::floor<std::chrono::seconds>(time);
  google::protobuf::Timestamp proto;
  proto.set_seconds(seconds.time_since_epoch().count());
  proto.set_nanos(static_cast<std::int32_t>((time - seconds).count() * 1000));
  return proto;
}

Time FromProto(const google::protobuf::Timestamp& time) {
  return TimeFromUnixMicros(time.seconds() * 1'000'000 + time.nanos() / 1000);
}

}  // namespace fathom::client
