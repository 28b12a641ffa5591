#include "storage/contact_codec.h"

#include <array>
#include <bit>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <utility>
#include <variant>

#include "base/status_macros.h"
#include "storage/blob.h"
#include "storage/column.h"

namespace fathom::storage {
namespace {

static_assert(std::endian::native == std::endian::little,
              "points are copied from memory; add a byte swap first");

// 2 added the recent reports; of an older one there are none. 3 is 2 and the
// contact's other names behind, written where it has any. 4 has the older
// estimates, and the names where it has any, written where there are such.
constexpr std::uint8_t kContactVersion = 2;
constexpr std::uint8_t kLinkedContactVersion = 3;
constexpr std::uint8_t kOlderContactVersion = 4;
// 2 is 1 and the other names behind, written where there were any.
constexpr std::uint8_t kLinkedEstimateVersion = 2;

// A recent report was gated, or gave so many points.
constexpr std::uint8_t kGatedFate = 3;

enum ReportFlag : std::uint8_t {
  kIsFix = 1,
  kHasDepth = 2,
  kHasDepthStd = 4,
  kInactive = 8,
  kHasSameAs = 16,
  kNothingObserved = 32,
  kAllReportFlags = 63,
};

void PutPoint(const map::GeodeticPoint& point, ByteWriter& writer) {
  writer.PutF64(point.latitude_deg);
  writer.PutF64(point.longitude_deg);
}

map::GeodeticPoint GetPoint(ByteReader& reader) {
  map::GeodeticPoint point;
  point.latitude_deg = reader.GetF64();
  point.longitude_deg = reader.GetF64();
  return point;
}

map::ContactClass GetContactClass(ByteReader& reader) {
  const auto contact_class = static_cast<map::ContactClass>(reader.GetU8());
  if (!map::IsContactClass(contact_class)) reader.Fail();
  return contact_class;
}

}  // namespace

void PutNames(const std::vector<map::ContactKey>& names, ByteWriter& writer) {
  writer.PutVarint(names.size());
  for (const map::ContactKey& name : names) {
    writer.PutString(name.source.value);
    writer.PutString(name.contact.value);
  }
}

std::vector<map::ContactKey> GetNames(ByteReader& reader) {
  std::vector<map::ContactKey> names(reader.GetCount(map::kMaxLinkedNames));
  for (map::ContactKey& name : names) {
    name.source.value = reader.GetString();
    name.contact.value = reader.GetString();
  }
  return names;
}

// One append for the whole: a writer that grows by each of 32 numbers takes
// longer to grow than to write. The size is checked in every build: it costs
// nothing, the compiler sees it.
void PutContactPoint(const map::ContactPoint& point, ByteWriter& writer) {
  std::array<std::uint8_t, kContactPointBytes> bytes;
  std::uint8_t* at = bytes.data();
  const std::uint8_t* const end = at + bytes.size();
  const auto put = [&at, end](auto number) {
    if (end - at < std::ptrdiff_t{sizeof(number)}) std::abort();
    std::memcpy(at, &number, sizeof(number));
    at += sizeof(number);
  };
  put(static_cast<std::uint8_t>(point.contact_class));
  put(static_cast<std::uint8_t>(point.status));
  for (const Time time : {point.time, point.report_time, point.track_start}) {
    put(static_cast<std::int64_t>(ToUnixMicros(time)));
  }
  put(point.frame_origin.latitude_deg);
  put(point.frame_origin.longitude_deg);
  for (int i = 0; i < 4; ++i) put(point.x(i));
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < 4; ++j) put(point.P(i, j));
  }
  put(point.top_depth_m);
  put(point.keel_depth_m);
  put(point.depth_std_m);
  put(point.radius_m);
  put(static_cast<std::uint64_t>(point.report_count));
  if (at != end) std::abort();
  writer.PutBytes(bytes);
}

void GetContactPoint(ByteReader& reader, map::ContactPoint& point) {
  point.contact_class = GetContactClass(reader);
  const std::uint8_t status = reader.GetU8();
  if (status < 1 || status > 4) reader.Fail();
  point.status = static_cast<map::ContactStatus>(status);
  point.time = reader.GetTime();
  point.report_time = reader.GetTime();
  point.track_start = reader.GetTime();
  point.frame_origin = GetPoint(reader);
  for (int i = 0; i < 4; ++i) point.x(i) = reader.GetF64();
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < 4; ++j) point.P(i, j) = reader.GetF64();
  }
  point.top_depth_m = reader.GetF64();
  point.keel_depth_m = reader.GetF64();
  point.depth_std_m = reader.GetF64();
  point.radius_m = reader.GetF64();
  point.report_count = reader.GetU64();
}

void PutContactReport(const map::ContactReport& report, ByteWriter& writer) {
  const auto* const fix = std::get_if<map::ContactFix>(&report.observation);
  std::uint8_t flags = 0;
  if (fix != nullptr) flags |= kIsFix;
  if (report.depth_m.has_value()) flags |= kHasDepth;
  if (report.depth_std_m.has_value()) flags |= kHasDepthStd;
  if (report.inactive) flags |= kInactive;
  if (report.same_as.has_value()) flags |= kHasSameAs;
  const auto* const polar = std::get_if<map::RangeBearing>(&report.observation);
  if (fix == nullptr && polar == nullptr) flags |= kNothingObserved;
  writer.PutU8(flags);
  writer.PutU8(static_cast<std::uint8_t>(report.contact_class));
  writer.PutTime(report.time);
  if (fix != nullptr) {
    PutPoint(fix->position, writer);
    writer.PutF64(fix->velocity_north_m_s);
    writer.PutF64(fix->velocity_east_m_s);
    writer.PutF64(fix->position_std_m);
    writer.PutF64(fix->velocity_std_m_s);
  } else if (polar != nullptr) {
    PutPoint(polar->pose.position, writer);
    writer.PutF64(polar->pose.depth_m);
    writer.PutF64(polar->pose.heading_deg);
    writer.PutF64(polar->pose.position_std_m);
    writer.PutF64(polar->range_m);
    writer.PutF64(polar->bearing_deg);
    writer.PutF64(polar->range_std_m);
    writer.PutF64(polar->bearing_std_deg);
  }
  if (report.depth_m.has_value()) writer.PutF64(*report.depth_m);
  if (report.depth_std_m.has_value()) writer.PutF64(*report.depth_std_m);
  if (report.same_as.has_value()) PutNames(*report.same_as, writer);
}

void GetContactReport(ByteReader& reader, map::ContactReport& report) {
  const std::uint8_t flags = reader.GetU8();
  if (flags > kAllReportFlags) reader.Fail();
  report.contact_class = GetContactClass(reader);
  report.time = reader.GetTime();
  if ((flags & kIsFix) != 0) {
    map::ContactFix fix;
    fix.position = GetPoint(reader);
    fix.velocity_north_m_s = reader.GetF64();
    fix.velocity_east_m_s = reader.GetF64();
    fix.position_std_m = reader.GetF64();
    fix.velocity_std_m_s = reader.GetF64();
    report.observation = fix;
  } else if ((flags & kNothingObserved) != 0) {
    report.observation = map::NothingObserved{};
  } else {
    map::RangeBearing polar;
    polar.pose.position = GetPoint(reader);
    polar.pose.depth_m = reader.GetF64();
    polar.pose.heading_deg = reader.GetF64();
    polar.pose.position_std_m = reader.GetF64();
    polar.range_m = reader.GetF64();
    polar.bearing_deg = reader.GetF64();
    polar.range_std_m = reader.GetF64();
    polar.bearing_std_deg = reader.GetF64();
    report.observation = polar;
  }
  if ((flags & kHasDepth) != 0) report.depth_m = reader.GetF64();
  if ((flags & kHasDepthStd) != 0) report.depth_std_m = reader.GetF64();
  report.inactive = (flags & kInactive) != 0;
  if ((flags & kHasSameAs) != 0) report.same_as = GetNames(reader);
}

absl::StatusOr<map::ContactEstimate> DecodeContactEstimate(
    ByteSpan blob, std::string_view what) {
  FATHOM_ASSIGN_OR_RETURN(
      const ByteSpan payload,
      OpenBlob(BlobKind::kContactEstimate, kLinkedEstimateVersion, blob, what));
  ByteReader reader(payload);
  map::ContactEstimate estimate;
  GetContactPoint(reader, estimate);
  if (blob[1] >= kLinkedEstimateVersion) estimate.linked = GetNames(reader);
  FATHOM_RETURN_IF_ERROR(reader.Finish(what));
  return estimate;
}

Bytes EncodeContact(const map::StoredContact& contact) {
  ByteWriter rows;
  rows.Reserve(contact.estimates.size() * kContactPointBytes);
  for (const map::ContactEstimate& estimate : contact.estimates) {
    PutContactPoint(estimate, rows);
  }
  ByteWriter writer = StartBlob();
  writer.PutString(contact.key.source.value);
  writer.PutString(contact.key.contact.value);
  writer.PutVarint(contact.estimates.size());
  PutRows(rows.bytes(), kContactPointBytes, writer);
  writer.PutVarint(contact.recent.size());
  for (const map::RecentReport& recent : contact.recent) {
    writer.PutU8(recent.gated ? kGatedFate : recent.points);
    PutContactReport(recent.report, writer);
  }
  std::uint8_t version =
      contact.links.has_value() ? kLinkedContactVersion : kContactVersion;
  if (!contact.older.empty()) {
    version = kOlderContactVersion;
    ByteWriter older;
    older.Reserve(contact.older.size() * kContactPointBytes);
    for (const map::ContactPoint& point : contact.older) {
      PutContactPoint(point, older);
    }
    writer.PutVarint(contact.older.size());
    PutRows(older.bytes(), kContactPointBytes, writer);
    writer.PutBool(contact.links.has_value());
  }
  if (contact.links.has_value()) {
    writer.PutTime(contact.links->since);
    PutNames(contact.links->names, writer);
  }
  return SealBlob(BlobKind::kContact, version, std::move(writer));
}

absl::StatusOr<map::StoredContact> DecodeContact(ByteSpan blob,
                                                 std::string_view what) {
  FATHOM_ASSIGN_OR_RETURN(
      const ByteSpan payload,
      OpenBlob(BlobKind::kContact, kOlderContactVersion, blob, what));
  ByteReader reader(payload);
  map::StoredContact contact;
  contact.key.source.value = reader.GetString();
  contact.key.contact.value = reader.GetString();
  const std::size_t count = reader.GetCount(map::kRecentEstimates);
  const Bytes bytes = GetRows(reader, count, kContactPointBytes);
  if (blob[1] >= 2) {
    contact.recent.resize(reader.GetCount(map::kRecentReports));
    for (map::RecentReport& recent : contact.recent) {
      const std::uint8_t fate = reader.GetU8();
      if (fate > kGatedFate) reader.Fail();
      recent.gated = fate == kGatedFate;
      recent.points = recent.gated ? 0 : fate;
      GetContactReport(reader, recent.report);
    }
  }
  bool linked = blob[1] == kLinkedContactVersion;
  Bytes older;
  if (blob[1] == kOlderContactVersion) {
    contact.older.resize(reader.GetCount(map::kOlderEstimates));
    if (contact.older.empty()) reader.Fail();
    older = GetRows(reader, contact.older.size(), kContactPointBytes);
    linked = reader.GetBool();
  }
  if (linked) {
    contact.links.emplace();
    contact.links->since = reader.GetTime();
    contact.links->names = GetNames(reader);
  }
  FATHOM_RETURN_IF_ERROR(reader.Finish(what));
  ByteReader older_rows(older);
  for (map::ContactPoint& point : contact.older) {
    GetContactPoint(older_rows, point);
  }
  FATHOM_RETURN_IF_ERROR(older_rows.Finish(what));
  ByteReader rows(bytes);
  contact.estimates.resize(count);
  for (map::ContactEstimate& estimate : contact.estimates) {
    estimate.key = contact.key;
    GetContactPoint(rows, estimate);
  }
  FATHOM_RETURN_IF_ERROR(rows.Finish(what));
  return contact;
}

}  // namespace fathom::storage
