// Pings and contact reports from the wire: validated, referred to the
// mission's datum, turned into domain values.
//
// What makes a whole message unusable (ids, numbering, times, poses, array
// lengths, a report's numbers) is an InvalidField here. What concerns one
// measurement of a ping (its range, depth, std) is left to the map, which
// refuses and counts it alone (thesis 4.3.3.1).
//
// Pure functions; thread-safe.

#ifndef FATHOM_SERVER_CONVERT_INGEST_H_
#define FATHOM_SERVER_CONVERT_INGEST_H_

#include <cstdint>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "fathom/v1/ingest_service.pb.h"
#include "map/contacts/contact_report.h"
#include "map/geodesy/ping.h"
#include "server/field_path.h"
#include "server/ingest.h"

namespace fathom::server {

// source_id, epoch and sequence of a v1::Ping or v1::ContactReport at `path`.
// Without these a message has no place in the order and cannot be judged.
template <typename Message>
absl::Status CheckNumbering(const Message& message, const FieldPath& path);

// The ping; depths below the mission's datum, bearings in radians.
absl::StatusOr<map::Ping> ConvertPing(const v1::Ping& ping,
                                      const FieldPath& path);

// The report; depths below the mission's datum. The observation of an
// inactive report may be absent.
absl::StatusOr<map::ContactReport> ConvertReport(
    const v1::ContactReport& report, const FieldPath& path);

// The message for the keeper: the converted content, or a Refusal that says
// why it is not. REQUIRES: CheckNumbering.
IngestMessage ToIngest(const v1::Ping& ping, const FieldPath& path);
IngestMessage ToIngest(const v1::ContactReport& report, const FieldPath& path);

// The message, or a Refusal in its place: a contact report stamped more than
// kMostAhead after `now`.
IngestMessage NotFromTheFuture(IngestMessage message, Time now,
                               const FieldPath& path);

// All reports of a batch, or the error of the first that is malformed.
// Errors: INVALID_ARGUMENT (path from "reports"), RESOURCE_EXHAUSTED past
// kMaxReportsPerRequest.
absl::StatusOr<std::vector<IngestMessage>> ConvertReports(
    const v1::ReportContactsRequest& request, Time now);

// What a refused message's Rejection says.
void WriteRejection(uint64_t sequence, const Refusal& refusal,
                    v1::Rejection* out);

}  // namespace fathom::server

#endif  // FATHOM_SERVER_CONVERT_INGEST_H_
