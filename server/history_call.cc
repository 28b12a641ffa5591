#include "server/history_call.h"

#include <optional>
#include <utility>

#include "base/status_macros.h"
#include "server/convert_common.h"
#include "server/convert_query.h"
#include "server/errors.h"
#include "server/field_checks.h"
#include "server/limits.h"
#include "storage/mission_file.h"

namespace fathom::server {
namespace {

// The area asked for, if one is.
absl::StatusOr<std::optional<storage::HistoryArea>> ConvertArea(
    const v1::GetContactHistoryRequest& request) {
  if (!request.has_south_west() && !request.has_north_east()) {
    return std::nullopt;
  }
  const FieldPath root;
  const FieldPath south_west_path(root, "south_west");
  const FieldPath north_east_path(root, "north_east");
  if (!request.has_south_west()) {
    return InvalidField(south_west_path.ToString(),
                        "is absent; an area needs both corners");
  }
  if (!request.has_north_east()) {
    return InvalidField(north_east_path.ToString(),
                        "is absent; an area needs both corners");
  }
  FATHOM_ASSIGN_OR_RETURN(const map::GeodeticPoint south_west,
                          CheckPoint(request.south_west(), south_west_path));
  FATHOM_ASSIGN_OR_RETURN(const map::GeodeticPoint north_east,
                          CheckPoint(request.north_east(), north_east_path));
  if (north_east.latitude_deg < south_west.latitude_deg) {
    return InvalidField(north_east_path.ToString(), "is south of south_west");
  }
  return storage::HistoryArea{.south_deg = south_west.latitude_deg,
                              .north_deg = north_east.latitude_deg,
                              .west_deg = south_west.longitude_deg,
                              .east_deg = north_east.longitude_deg};
}

// Messages of estimates, as many as one call may have.
class HistoryMessages {
 public:
  // False: there are more than there may be.
  bool Add(const storage::ContactHistoryRow& row) {
    if (count_++ == kMaxHistoryEstimates) return false;
    if ((count_ - 1) % kHistoryEstimatesPerMessage == 0) {
      messages_.emplace_back();
    }
    WriteContact(row.estimate, messages_.back().add_estimates());
    return true;
  }
  absl::StatusOr<std::deque<v1::GetContactHistoryResponse>> Take() {
    if (count_ > kMaxHistoryEstimates) return TooMany();
    return std::move(messages_);
  }
  static absl::Status TooMany() {
    return LimitExceeded("estimates between start_time and end_time",
                         kMaxHistoryEstimates + 1, kMaxHistoryEstimates);
  }

 private:
  std::deque<v1::GetContactHistoryResponse> messages_;
  size_t count_ = 0;
};

// CANCELLED soon after `stop` is true.
absl::StatusOr<std::deque<v1::GetContactHistoryResponse>> ReadHistory(
    storage::MissionFile& file, const v1::GetContactHistoryRequest& request,
    const std::atomic<bool>& stop) {
  if (stop) return absl::CancelledError("client has gone");
  const FieldPath root;
  FATHOM_ASSIGN_OR_RETURN(const std::optional<storage::HistoryArea> area,
                          ConvertArea(request));
  const bool of_all = area.has_value() && request.source_id().empty() &&
                      request.contact_id().empty();
  if (!of_all) {
    FATHOM_RETURN_IF_ERROR(
        CheckId(request.source_id(), FieldPath(root, "source_id")));
    FATHOM_RETURN_IF_ERROR(CheckId(request.contact_id(),
                                   FieldPath(root, "contact_id"),
                                   /*allow_colon=*/true));
  }
  Time from = Time::min();
  Time to = Time::max();
  if (request.has_start_time()) {
    FATHOM_ASSIGN_OR_RETURN(
        from, CheckTime(request.start_time(), FieldPath(root, "start_time")));
  }
  const FieldPath end_path(root, "end_time");
  if (request.has_end_time()) {
    FATHOM_ASSIGN_OR_RETURN(to, CheckTime(request.end_time(), end_path));
    if (to < from) {
      return InvalidField(end_path.ToString(), "is before start_time");
    }
  }
  HistoryMessages messages;
  if (of_all) {
    const auto rows =
        file.ReadContactHistoryIn(*area, from, to, kMaxHistoryEstimates, &stop);
    if (absl::IsResourceExhausted(rows.status())) {
      return HistoryMessages::TooMany();
    }
    FATHOM_RETURN_IF_ERROR(rows.status());
    for (const storage::ContactHistoryRow& row : *rows) messages.Add(row);
    return messages.Take();
  }
  const map::ContactKey key = {.source = {request.source_id()},
                               .contact = {request.contact_id()}};
  const absl::Status read = file.ReadContactHistory(
      key, from, to, [&](const storage::ContactHistoryRow& row) {
        if (stop) return false;
        if (area.has_value() && !area->Holds(row.estimate.Position())) {
          return true;
        }
        return messages.Add(row);
      });
  if (absl::IsNotFound(read)) {
    return NoSuchContact(request.source_id(), request.contact_id());
  }
  FATHOM_RETURN_IF_ERROR(read);
  if (stop) return absl::CancelledError("client has gone");
  return messages.Take();
}

}  // namespace

HistoryStream::HistoryStream(ServerContext& context,
                             const v1::GetContactHistoryRequest& request)
    : context_(context) {
  context_.workers.Give([this, request] {
    auto messages = ReadHistory(context_.file, request, gone_);
    if (!messages.ok()) {
      Finish(ToGrpc(messages.status()));
      return;
    }
    messages_ = *std::move(messages);
    WriteNext();
  });
}

void HistoryStream::OnWriteDone(bool ok) {
  messages_.pop_front();
  if (!ok) messages_.clear();
  WriteNext();
}

void HistoryStream::OnDone() {
  context_.bulk_calls.GiveBack();
  delete this;
}

void HistoryStream::WriteNext() {
  if (messages_.empty()) {
    Finish(grpc::Status::OK);
  } else {
    StartWrite(&messages_.front());
  }
}

}  // namespace fathom::server
