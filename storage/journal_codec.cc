#include "storage/journal_codec.h"

#include <algorithm>
#include <string>
#include <unordered_map>
#include <utility>
#include <variant>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "storage/activity_codec.h"
#include "storage/blob.h"
#include "storage/column.h"
#include "storage/contact_codec.h"

namespace fathom::storage {
namespace {

// 2 is 1 with reports that link names, written where a segment holds any.
constexpr std::uint8_t kJournalVersion = 1;
constexpr std::uint8_t kLinkingJournalVersion = 2;

// Stored: never reuse a number. In the order of JournalRecord's variant.
enum RecordKind : std::uint8_t {
  kPing = 1,
  kContact = 2,
  kStartActivity = 3,
  kDropContact = 4,
};

static_assert(sizeof(map::Beam) == 16);

// Bounds what a damaged segment may claim: the largest record's row is an
// activity with two ids of kMaxStringBytes.
constexpr std::size_t kMaxRowBytes = 4 * kMaxStringBytes;
constexpr std::size_t kMaxSegmentRowBytes = 64 << 20;

// A segment ends behind the ping that fills it: room for that one's beams.
constexpr std::size_t kUsualBeams = 1 << 12;

// Ids of a segment, each written once.
class IdTable {
 public:
  std::uint64_t IndexOf(const std::string& id) {
    const auto [found, is_new] = indices_.try_emplace(id, ids_.size());
    if (is_new) ids_.push_back(&found->first);
    return found->second;
  }
  void PutTo(ByteWriter& writer) const {
    writer.PutVarint(ids_.size());
    for (const std::string* id : ids_) writer.PutString(*id);
  }

 private:
  // Elements of an unordered_map stay where they are.
  std::unordered_map<std::string, std::uint64_t> indices_;
  std::vector<const std::string*> ids_;
};

class SegmentWriter {
 public:
  // `beams`: how many may come.
  explicit SegmentWriter(std::size_t beams) {
    beams_.reserve(std::min(beams, kTargetBeams + kUsualBeams));
  }

  void Add(const JournalRecord& record) {
    if (segment_.record_count == 0) segment_.first_revision = record.revision;
    segment_.last_revision = record.revision;
    ++segment_.record_count;
    rows_.PutU8(static_cast<std::uint8_t>(record.event.index() + 1));
    rows_.PutU64(record.revision);
    std::visit([this](const auto& event) { AddEvent(event); }, record.event);
  }

  bool full() const {
    return beams_.size() >= kTargetBeams ||
           segment_.record_count >= kMaxSegmentRecords ||
           rows_.size() >= kMaxSegmentRowBytes - kMaxRowBytes;
  }
  bool empty() const { return segment_.record_count == 0; }

  JournalSegment Finish() {
    ByteWriter writer = StartBlob();
    writer.PutVarint(segment_.record_count);
    ids_.PutTo(writer);
    writer.PutVarint(rows_.size());
    PutColumn(rows_.bytes(), writer);
    writer.PutVarint(beams_.size());
    PutColumnBytes(beams_.data(), beams_.size(), sizeof(map::Beam), writer);
    segment_.content = SealBlob(
        BlobKind::kJournalSegment,
        links_ ? kLinkingJournalVersion : kJournalVersion, std::move(writer));
    return std::move(segment_);
  }

 private:
  void AddEvent(const PingRecord& record) {
    const map::Ping& ping = record.ping;
    rows_.PutVarint(ids_.IndexOf(record.source.value));
    rows_.PutU64(record.epoch);
    rows_.PutU64(record.sequence);
    rows_.PutVarint(ids_.IndexOf(ping.activity.value));
    rows_.PutTime(ping.time);
    rows_.PutF64(ping.pose.position.latitude_deg);
    rows_.PutF64(ping.pose.position.longitude_deg);
    rows_.PutF64(ping.pose.depth_m);
    rows_.PutF64(ping.pose.heading_deg);
    rows_.PutF64(ping.pose.position_std_m);
    rows_.PutVarint(ping.beams.size());
    beams_.insert(beams_.end(), ping.beams.begin(), ping.beams.end());
  }
  void AddEvent(const ContactRecord& record) {
    links_ = links_ || record.report.same_as.has_value();
    AddKey(record.report.key);
    rows_.PutU64(record.epoch);
    rows_.PutU64(record.sequence);
    PutContactReport(record.report, rows_);
  }
  void AddEvent(const map::StartActivity& start) {
    PutStartActivity(start, rows_);
  }
  void AddEvent(const map::DropContact& drop) {
    AddKey(drop.key);
    rows_.PutTime(drop.time);
  }
  void AddKey(const map::ContactKey& key) {
    rows_.PutVarint(ids_.IndexOf(key.source.value));
    rows_.PutVarint(ids_.IndexOf(key.contact.value));
  }

  JournalSegment segment_;
  bool links_ = false;
  IdTable ids_;
  ByteWriter rows_;
  std::vector<map::Beam> beams_;
};

class SegmentReader {
 public:
  // Takes apart the payload; ok() tells whether that worked.
  explicit SegmentReader(ByteSpan payload) : reader_(payload), rows_({}) {
    record_count_ = reader_.GetCount(kMaxSegmentRecords);
    const std::size_t ids = reader_.GetCount(2 * kMaxSegmentRecords);
    for (std::size_t i = 0; i < ids && reader_.ok(); ++i) {
      ids_.push_back(reader_.GetString());
    }
    const std::size_t row_bytes = reader_.GetCount(kMaxSegmentRowBytes);
    row_bytes_ = GetColumn<std::uint8_t>(reader_, row_bytes);
    rows_ = ByteReader(row_bytes_);
    const std::size_t beams = reader_.GetCount(kMaxSegmentBeams);
    if (!reader_.ok()) return;
    beams_.resize(beams);
    GetColumnBytes(reader_, beams, sizeof(map::Beam), beams_.data());
  }

  absl::Status ReadAll(std::string_view what,
                       std::vector<JournalRecord>& records) {
    FATHOM_RETURN_IF_ERROR(reader_.Finish(what));
    for (std::size_t i = 0; i < record_count_ && rows_.ok(); ++i) {
      records.push_back(Next());
    }
    FATHOM_RETURN_IF_ERROR(rows_.Finish(what));
    if (next_beam_ != beams_.size()) {
      return absl::DataLossError(absl::StrFormat(
          "%s: %d beams, its pings have %d", what, beams_.size(), next_beam_));
    }
    return absl::OkStatus();
  }

 private:
  JournalRecord Next() {
    JournalRecord record;
    const std::uint8_t kind = rows_.GetU8();
    record.revision = rows_.GetU64();
    switch (kind) {
      case kPing:
        record.event = NextPing();
        break;
      case kContact: {
        ContactRecord contact;
        contact.report.key = NextKey();
        contact.epoch = rows_.GetU64();
        contact.sequence = rows_.GetU64();
        GetContactReport(rows_, contact.report);
        record.event = std::move(contact);
        break;
      }
      case kStartActivity: {
        map::StartActivity start;
        GetStartActivity(rows_, start);
        record.event = std::move(start);
        break;
      }
      case kDropContact: {
        map::DropContact drop;
        drop.key = NextKey();
        drop.time = rows_.GetTime();
        record.event = std::move(drop);
        break;
      }
      default:
        rows_.Fail();
    }
    return record;
  }

  PingRecord NextPing() {
    PingRecord record;
    record.source.value = NextId();
    record.epoch = rows_.GetU64();
    record.sequence = rows_.GetU64();
    map::Ping& ping = record.ping;
    ping.activity.value = NextId();
    ping.time = rows_.GetTime();
    ping.pose.position.latitude_deg = rows_.GetF64();
    ping.pose.position.longitude_deg = rows_.GetF64();
    ping.pose.depth_m = rows_.GetF64();
    ping.pose.heading_deg = rows_.GetF64();
    ping.pose.position_std_m = rows_.GetF64();
    const std::size_t beams = rows_.GetCount(beams_.size() - next_beam_);
    const auto first = beams_.begin() + static_cast<std::ptrdiff_t>(next_beam_);
    ping.beams.assign(first, first + static_cast<std::ptrdiff_t>(beams));
    next_beam_ += beams;
    return record;
  }

  map::ContactKey NextKey() {
    map::ContactKey key;
    key.source.value = NextId();
    key.contact.value = NextId();
    return key;
  }

  std::string NextId() {
    const std::uint64_t index = rows_.GetVarint();
    if (index >= ids_.size()) {
      rows_.Fail();
      return {};
    }
    return ids_[static_cast<std::size_t>(index)];
  }

  ByteReader reader_;
  std::size_t record_count_ = 0;
  std::vector<std::string> ids_;
  Bytes row_bytes_;
  ByteReader rows_;
  std::vector<map::Beam> beams_;
  std::size_t next_beam_ = 0;
};

absl::Status CheckId(const std::string& id) {
  if (id.size() <= kMaxStringBytes) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrFormat(
      "id of %d bytes; at most %d", id.size(), kMaxStringBytes));
}

absl::Status CheckRecord(const JournalRecord& record) {
  if (const auto* ping = std::get_if<PingRecord>(&record.event)) {
    if (ping->ping.beams.size() > kMaxBeamsPerRecord) {
      return absl::InvalidArgumentError(
          absl::StrFormat("ping of %d beams; at most %d",
                          ping->ping.beams.size(), kMaxBeamsPerRecord));
    }
    FATHOM_RETURN_IF_ERROR(CheckId(ping->source.value));
    return CheckId(ping->ping.activity.value);
  }
  if (const auto* contact = std::get_if<ContactRecord>(&record.event)) {
    FATHOM_RETURN_IF_ERROR(CheckId(contact->report.key.source.value));
    if (contact->report.same_as.has_value()) {
      for (const map::ContactKey& name : *contact->report.same_as) {
        FATHOM_RETURN_IF_ERROR(CheckId(name.source.value));
        FATHOM_RETURN_IF_ERROR(CheckId(name.contact.value));
      }
    }
    return CheckId(contact->report.key.contact.value);
  }
  if (const auto* start = std::get_if<map::StartActivity>(&record.event)) {
    FATHOM_RETURN_IF_ERROR(CheckId(start->id.value));
    return CheckId(start->vehicle_id);
  }
  const auto& drop = std::get<map::DropContact>(record.event);
  FATHOM_RETURN_IF_ERROR(CheckId(drop.key.source.value));
  return CheckId(drop.key.contact.value);
}

}  // namespace

absl::StatusOr<std::vector<JournalSegment>> EncodeJournal(
    std::span<const JournalRecord> records) {
  std::vector<JournalSegment> segments;
  std::size_t beams = 0;
  for (const JournalRecord& record : records) {
    if (const auto* ping = std::get_if<PingRecord>(&record.event)) {
      beams += ping->ping.beams.size();
    }
  }
  SegmentWriter writer(beams);
  for (const JournalRecord& record : records) {
    FATHOM_RETURN_IF_ERROR(CheckRecord(record));
    writer.Add(record);
    if (writer.full()) {
      segments.push_back(writer.Finish());
      writer = SegmentWriter(beams);
    }
  }
  if (!writer.empty()) segments.push_back(writer.Finish());
  return segments;
}

absl::Status DecodeJournal(ByteSpan blob, std::string_view what,
                           std::vector<JournalRecord>& records) {
  FATHOM_ASSIGN_OR_RETURN(
      const ByteSpan payload,
      OpenBlob(BlobKind::kJournalSegment, kLinkingJournalVersion, blob, what));
  return SegmentReader(payload).ReadAll(what, records);
}

}  // namespace fathom::storage
