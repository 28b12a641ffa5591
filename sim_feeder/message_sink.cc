#include "sim_feeder/message_sink.h"

#include <google/protobuf/util/delimited_message_util.h>

#include <string_view>
#include <utility>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"

namespace fathom::feeder {
namespace {

std::string ReasonName(v1::RejectReason reason) {
  constexpr std::string_view kPrefix = "REJECT_REASON_";
  std::string name = v1::RejectReason_Name(reason);
  if (name.starts_with(kPrefix)) name.erase(0, kPrefix.size());
  return name;
}

template <typename Message>
absl::Status Record(Message& message, const std::string& source_id,
                    std::ofstream& file, client::IngestProgress& progress) {
  progress.epoch = 1;
  ++progress.sent_sequence;
  message.set_source_id(source_id);
  message.set_epoch(progress.epoch);
  message.set_sequence(progress.sent_sequence);
  if (!file.is_open()) return absl::OkStatus();
  if (!google::protobuf::util::SerializeDelimitedToOstream(message, &file)) {
    return absl::DataLossError("cannot write to the record file; disk full?");
  }
  return absl::OkStatus();
}

absl::Status OpenForWriting(const std::string& path, std::ofstream& file) {
  if (path.empty()) return absl::OkStatus();
  file.open(path, std::ios::binary | std::ios::trunc);
  if (!file) {
    return absl::PermissionDeniedError(
        absl::StrFormat("cannot write to %s", path));
  }
  return absl::OkStatus();
}

absl::Status CloseWritten(std::ofstream& file) {
  if (!file.is_open()) return absl::OkStatus();
  file.close();
  if (!file) {
    return absl::DataLossError("cannot write to the record file; disk full?");
  }
  return absl::OkStatus();
}

}  // namespace

std::map<std::string, std::uint64_t> RejectCounts(
    std::span<const v1::RejectCount> rejects) {
  std::map<std::string, std::uint64_t> counts;
  for (const v1::RejectCount& reject : rejects) {
    counts[ReasonName(reject.reason())] += reject.count();
  }
  return counts;
}

std::map<std::string, std::uint64_t> RejectCounts(
    const client::IngestProgress& progress) {
  return RejectCounts(progress.rejects);
}

std::string RejectNote(const SinkState& state) {
  std::string note;
  for (const client::IngestProgress* progress :
       {&state.pings, &state.reports}) {
    for (const auto& [reason, count] : RejectCounts(*progress)) {
      note += absl::StrFormat("  %s %d", reason, count);
    }
  }
  if (note.empty()) note = "  no rejects";
  if (state.buffered > 0)
    note += absl::StrFormat("  BUFFERED %d", state.buffered);
  if (state.dropped > 0) note += absl::StrFormat("  DROPPED %d", state.dropped);
  return note;
}

absl::StatusOr<std::unique_ptr<StreamSink>> StreamSink::Open(
    const client::Client& client, const client::IngestStreamOptions& options) {
  FATHOM_ASSIGN_OR_RETURN(std::unique_ptr<client::PingStream> pings,
                          client.OpenPingStream(options));
  return std::unique_ptr<StreamSink>(
      new StreamSink(client, options, std::move(pings)));
}

StreamSink::StreamSink(const client::Client& client,
                       const client::IngestStreamOptions& options,
                       std::unique_ptr<client::PingStream> pings)
    : client_(client), options_(options), pings_(std::move(pings)) {}

absl::Status StreamSink::SendPing(v1::Ping& ping) {
  return pings_->Send(ping).status();
}

absl::Status StreamSink::SendReport(v1::ContactReport& report) {
  if (reports_ == nullptr) {
    FATHOM_ASSIGN_OR_RETURN(reports_, client_.OpenContactStream(options_));
  }
  return reports_->Send(report).status();
}

absl::Status StreamSink::Finish() {
  FATHOM_RETURN_IF_ERROR(pings_->Finish());
  if (reports_ != nullptr) FATHOM_RETURN_IF_ERROR(reports_->Finish());
  return absl::OkStatus();
}

SinkState StreamSink::State() const {
  SinkState state;
  state.pings = pings_->progress();
  if (reports_ != nullptr) state.reports = reports_->progress();
  return state;
}

absl::StatusOr<std::unique_ptr<RecordSink>> RecordSink::Open(
    const std::string& pings_path, const std::string& reports_path,
    const std::string& source_id) {
  std::unique_ptr<RecordSink> sink(new RecordSink(source_id));
  FATHOM_RETURN_IF_ERROR(OpenForWriting(pings_path, sink->pings_));
  FATHOM_RETURN_IF_ERROR(OpenForWriting(reports_path, sink->reports_));
  return sink;
}

absl::Status RecordSink::SendPing(v1::Ping& ping) {
  return Record(ping, source_id_, pings_, state_.pings);
}

absl::Status RecordSink::SendReport(v1::ContactReport& report) {
  return Record(report, source_id_, reports_, state_.reports);
}

absl::Status RecordSink::Finish() {
  FATHOM_RETURN_IF_ERROR(CloseWritten(pings_));
  return CloseWritten(reports_);
}

}  // namespace fathom::feeder
