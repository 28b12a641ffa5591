#include "storage/activity_codec.h"

#include <utility>

#include "base/status_macros.h"
#include "storage/blob.h"

namespace fathom::storage {
namespace {

constexpr std::uint8_t kActivityVersion = 1;

void PutOptional(const std::optional<float>& value, ByteWriter& writer) {
  writer.PutBool(value.has_value());
  if (value.has_value()) writer.PutF32(*value);
}

std::optional<float> GetOptional(ByteReader& reader) {
  if (!reader.GetBool()) return std::nullopt;
  return reader.GetF32();
}

}  // namespace

void PutStartActivity(const map::StartActivity& start, ByteWriter& writer) {
  writer.PutString(start.id.value);
  writer.PutString(start.vehicle_id);
  writer.PutTime(start.start);
  const map::LocalMapOptions& options = start.options;
  writer.PutF64(options.south_west.latitude_deg);
  writer.PutF64(options.south_west.longitude_deg);
  writer.PutF64(options.north_extent_m);
  writer.PutF64(options.east_extent_m);
  writer.PutF64(options.cell_size_m);
  writer.PutU8(static_cast<std::uint8_t>(options.estimator));
  writer.PutF64(options.min_range_m);
  writer.PutF64(options.max_range_m);
  writer.PutF64(options.smoothing_distance_m);
  writer.PutF64(options.smoothing_scale);
  PutOptional(options.default_depth_m, writer);
  PutOptional(options.default_std_m, writer);
}

void GetStartActivity(ByteReader& reader, map::StartActivity& start) {
  start.id.value = reader.GetString();
  start.vehicle_id = reader.GetString();
  start.start = reader.GetTime();
  map::LocalMapOptions& options = start.options;
  options.south_west.latitude_deg = reader.GetF64();
  options.south_west.longitude_deg = reader.GetF64();
  options.north_extent_m = reader.GetF64();
  options.east_extent_m = reader.GetF64();
  options.cell_size_m = reader.GetF64();
  const std::uint8_t estimator = reader.GetU8();
  if (estimator < 1 || estimator > 3) reader.Fail();
  options.estimator = static_cast<map::EstimatorKind>(estimator);
  options.min_range_m = reader.GetF64();
  options.max_range_m = reader.GetF64();
  options.smoothing_distance_m = reader.GetF64();
  options.smoothing_scale = reader.GetF64();
  options.default_depth_m = GetOptional(reader);
  options.default_std_m = GetOptional(reader);
}

Bytes EncodeActivity(const map::StoredActivity& activity) {
  ByteWriter writer = StartBlob();
  PutStartActivity(activity.start, writer);
  writer.PutBool(activity.open);
  writer.PutU64(activity.measurements_accepted);
  writer.PutU64(activity.cells_measured);
  writer.PutU8(map::kRejectReasonEnd - 1);
  for (std::size_t reason = 1; reason < map::kRejectReasonEnd; ++reason) {
    writer.PutU64(
        activity.rejects.count(static_cast<map::RejectReason>(reason)));
  }
  return SealBlob(BlobKind::kActivity, kActivityVersion, std::move(writer));
}

absl::StatusOr<map::StoredActivity> DecodeActivity(ByteSpan blob,
                                                   std::string_view what) {
  FATHOM_ASSIGN_OR_RETURN(
      const ByteSpan payload,
      OpenBlob(BlobKind::kActivity, kActivityVersion, blob, what));
  ByteReader reader(payload);
  map::StoredActivity activity;
  GetStartActivity(reader, activity.start);
  activity.open = reader.GetBool();
  activity.measurements_accepted = reader.GetU64();
  activity.cells_measured = reader.GetU64();
  // An older program knew fewer reasons; a newer one has a newer version.
  const std::size_t reasons = reader.GetU8();
  if (reasons >= map::kRejectReasonEnd) reader.Fail();
  for (std::size_t reason = 1; reader.ok() && reason <= reasons; ++reason) {
    activity.rejects.Add(static_cast<map::RejectReason>(reason),
                         reader.GetU64());
  }
  FATHOM_RETURN_IF_ERROR(reader.Finish(what));
  return activity;
}

}  // namespace fathom::storage
