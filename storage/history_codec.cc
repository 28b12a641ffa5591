#include "storage/history_codec.h"

#include <string>
#include <utility>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "storage/blob.h"
#include "storage/column.h"
#include "storage/contact_codec.h"

namespace fathom::storage {
namespace {

constexpr std::uint8_t kVersion = 1;

// The revision and the point.
constexpr std::size_t kRowBytes = 8 + kContactPointBytes;

}  // namespace

std::vector<map::GeodeticPoint> PositionsOf(
    std::span<const ContactHistoryRow> rows) {
  std::vector<map::GeodeticPoint> positions;
  positions.reserve(rows.size());
  for (const ContactHistoryRow& row : rows) {
    positions.push_back(row.estimate.Position());
  }
  return positions;
}

std::string WhatOfBlock(std::int64_t contact_number, std::int64_t block_id) {
  return absl::StrFormat("contact_history block_id=%d of contact_number=%d",
                         block_id, contact_number);
}

bool IsBefore(const ContactHistoryRow& a, const ContactHistoryRow& b) {
  return a.estimate.time != b.estimate.time ? a.estimate.time < b.estimate.time
                                            : a.revision < b.revision;
}

Bytes EncodeHistory(std::int64_t contact_number,
                    std::span<const ContactHistoryRow> rows) {
  ByteWriter table;
  table.Reserve(rows.size() * kRowBytes);
  ByteWriter names;
  std::size_t changes = 0;
  const std::vector<map::ContactKey> none;
  const std::vector<map::ContactKey>* held = &none;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const map::ContactEstimate& estimate = rows[i].estimate;
    table.PutU64(rows[i].revision);
    PutContactPoint(estimate, table);
    if (estimate.linked == *held) continue;
    held = &estimate.linked;
    changes += 1;
    names.PutVarint(i);
    PutNames(*held, names);
  }
  ByteWriter writer = StartBlob();
  writer.PutI64(contact_number);
  writer.PutVarint(rows.size());
  PutRows(table.bytes(), kRowBytes, writer);
  writer.PutVarint(changes);
  writer.PutBytes(names.bytes());
  return SealBlob(BlobKind::kContactHistory, kVersion, std::move(writer));
}

absl::StatusOr<std::vector<ContactHistoryRow>> DecodeHistory(
    ByteSpan blob, std::int64_t contact_number, std::string_view what) {
  FATHOM_ASSIGN_OR_RETURN(
      const ByteSpan payload,
      OpenBlob(BlobKind::kContactHistory, kVersion, blob, what));
  ByteReader reader(payload);
  const std::int64_t holder = reader.GetI64();
  const std::size_t count = reader.GetCount(kMaxBlockEstimates);
  if (count == 0) reader.Fail();
  const Bytes table = GetRows(reader, count, kRowBytes);
  ByteReader points(table);
  std::vector<ContactHistoryRow> rows(reader.ok() ? count : 0);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    rows[i].revision = points.GetU64();
    GetContactPoint(points, rows[i].estimate);
    if (i > 0 && !IsBefore(rows[i - 1], rows[i])) reader.Fail();
  }
  const std::size_t changes = reader.GetCount(count);
  std::vector<map::ContactKey> names;
  std::size_t next = 0;  // Rows from here on have `names`.
  for (std::size_t i = 0; i < changes; ++i) {
    const std::size_t first = reader.GetCount(count - 1);
    if (first < next || (i > 0 && first == next)) reader.Fail();
    if (!reader.ok()) break;
    for (; next < first; ++next) rows[next].estimate.linked = names;
    names = GetNames(reader);
  }
  for (; next < rows.size(); ++next) rows[next].estimate.linked = names;
  FATHOM_RETURN_IF_ERROR(reader.Finish(what));
  FATHOM_RETURN_IF_ERROR(points.Finish(what));
  if (holder != contact_number) {
    return absl::DataLossError(
        absl::StrFormat("%s: holds contact_number=%d", what, holder));
  }
  return rows;
}

}  // namespace fathom::storage
