// A block of a contact's history as bytes: up to kMaxBlockEstimates estimates,
// in order of time and revision. Lossless. docs/storage_format.md has the
// layout and the reasons. Thread-safe.

#ifndef FATHOM_STORAGE_HISTORY_CODEC_H_
#define FATHOM_STORAGE_HISTORY_CODEC_H_

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "map/geodesy/points.h"
#include "storage/bytes.h"
#include "storage/mission_records.h"

namespace fathom::storage {

// A block is written when it has so many, or with a checkpoint. 128 share one
// insert into four trees, and a read of a short while decodes 32 KiB at most
// twice over.
inline constexpr std::size_t kBlockEstimates = 128;

// The most that a block may hold; what is more is divided.
inline constexpr std::size_t kMaxBlockEstimates = 2 * kBlockEstimates;

// `contact_number`, the row's, is found again by DecodeHistory: a block that
// lost its place is found out. Names of `rows` are not written.
// REQUIRES: 1 to kMaxBlockEstimates rows.
Bytes EncodeHistory(std::int64_t contact_number,
                    std::span<const ContactHistoryRow> rows);

// The rows, without their keys. Errors: DATA_LOSS naming `what`: damaged,
// another contact's, or not in order; UNIMPLEMENTED for a newer version.
absl::StatusOr<std::vector<ContactHistoryRow>> DecodeHistory(
    ByteSpan blob, std::int64_t contact_number, std::string_view what);

// Where each row is.
std::vector<map::GeodeticPoint> PositionsOf(
    std::span<const ContactHistoryRow> rows);

// A block's name in errors.
std::string WhatOfBlock(std::int64_t contact_number, std::int64_t block_id);

// Order of a history: by time, at one time by revision.
bool IsBefore(const ContactHistoryRow& a, const ContactHistoryRow& b);

}  // namespace fathom::storage

#endif  // FATHOM_STORAGE_HISTORY_CODEC_H_
