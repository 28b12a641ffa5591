#include "sim_feeder/replay/replay_command.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>
#include <thread>
#include <unordered_set>
#include <utility>

#include "absl/strings/str_format.h"
#include "base/clock.h"
#include "base/status_macros.h"
#include "client/client.h"
#include "client/proto_time.h"
#include "map/geodesy/ned_frame.h"
#include "sim_feeder/activity.h"
#include "sim_feeder/angles.h"
#include "sim_feeder/progress_bar.h"
#include "sim_feeder/replay/sounding_pings.h"

namespace fathom::feeder {
namespace {

using SteadyClock = std::chrono::steady_clock;

// Distinct contacts that are counted; beyond it the count stays.
constexpr std::size_t kMaxContacts = 1'000'000;

// The places that a recording's depths fall on, as a box of latitude and
// longitude, the latter relative to the first place.
class Extent {
 public:
  void Add(const map::GeodeticPoint& place) {
    if (!first_.has_value()) first_ = place;
    const double east_deg =
        std::remainder(place.longitude_deg - first_->longitude_deg, 360.0);
    south_deg_ = std::min(south_deg_, place.latitude_deg);
    north_deg_ = std::max(north_deg_, place.latitude_deg);
    west_deg_ = std::min(west_deg_, east_deg);
    east_deg_ = std::max(east_deg_, east_deg);
  }

  void Add(const v1::Ping& ping) {
    const v1::VehiclePose& pose = ping.pose();
    const map::NedFrame frame(
        {.latitude_deg = pose.position().latitude_deg(),
         .longitude_deg = pose.position().longitude_deg()});
    // The ends of a fan are its farthest beams.
    for (int n = 0; n < ping.range_m_size(); ++n) {
      const double azimuth_rad =
          (pose.heading_deg() + ping.bearing_deg(n)) * kRadiansPerDegree;
      Add(frame.ToGeodetic(ping.range_m(n) * std::cos(azimuth_rad),
                           ping.range_m(n) * std::sin(azimuth_rad)));
    }
  }

  // The area of whole cells that holds them all.
  std::optional<SurveyArea> Area(double cell_m) const {
    if (!first_.has_value()) return std::nullopt;
    const auto at = [&](double latitude_deg, double east_deg) {
      return map::GeodeticPoint{.latitude_deg = latitude_deg,
                                .longitude_deg = std::remainder(
                                    first_->longitude_deg + east_deg, 360.0)};
    };
    // Parallels bend: corners and the middles of both of them.
    const double middle_deg = 0.5 * (west_deg_ + east_deg_);
    const std::array<map::GeodeticPoint, 6> marks = {
        at(south_deg_, west_deg_),  at(south_deg_, middle_deg),
        at(south_deg_, east_deg_),  at(north_deg_, west_deg_),
        at(north_deg_, middle_deg), at(north_deg_, east_deg_)};
    const double margin_m = 2 * cell_m;
    const Box about = BoxOf(map::NedFrame(marks[0]), marks);
    SurveyArea area = {.south_west = map::NedFrame(marks[0]).ToGeodetic(
                           about.south_m - margin_m, about.west_m - margin_m),
                       .cell_size_m = cell_m};
    const Box within = BoxOf(map::NedFrame(area.south_west), marks);
    area.north_extent_m = within.north_m + margin_m;
    area.east_extent_m = within.east_m + margin_m;
    return area;
  }

 private:
  struct Box {
    double south_m = 0;
    double north_m = 0;
    double west_m = 0;
    double east_m = 0;
  };

  static Box BoxOf(const map::NedFrame& frame,
                   const std::array<map::GeodeticPoint, 6>& marks) {
    Box box;
    for (const map::GeodeticPoint& mark : marks) {
      const map::NedPoint at = frame.ToNed(mark);
      box.south_m = std::min(box.south_m, at.north_m);
      box.north_m = std::max(box.north_m, at.north_m);
      box.west_m = std::min(box.west_m, at.east_m);
      box.east_m = std::max(box.east_m, at.east_m);
    }
    return box;
  }

  std::optional<map::GeodeticPoint> first_;
  double south_deg_ = std::numeric_limits<double>::infinity();
  double north_deg_ = -std::numeric_limits<double>::infinity();
  double west_deg_ = 0;
  double east_deg_ = 0;
};

// Reads all recordings in order and calls `take` with each message, soundings
// made pings; `read` after each recording.
absl::Status ForEachMessage(
    const ReplayOptions& options,
    const std::function<absl::Status(RecordedEvent&)>& take,
    const std::function<void(const Recording&)>& read,
    std::uint64_t* soundings) {
  SoundingPings grouped;
  const auto send = [&](std::optional<RecordedEvent> event) {
    return event.has_value() ? take(*event) : absl::OkStatus();
  };
  for (const std::string& path : options.paths) {
    FATHOM_ASSIGN_OR_RETURN(const std::unique_ptr<Recording> recording,
                            OpenRecording(path, options.recording));
    for (;;) {
      absl::StatusOr<std::optional<RecordedEvent>> next = recording->Next();
      if (!next.ok()) {
        return absl::Status(
            next.status().code(),
            absl::StrFormat("%s: %s", path,
                            std::string(next.status().message())));
      }
      if (!next->has_value()) break;
      RecordedEvent& event = **next;
      if (const Sounding* sounding = std::get_if<Sounding>(&event.what)) {
        if (soundings != nullptr) ++*soundings;
        FATHOM_RETURN_IF_ERROR(send(grouped.Add(event.time, *sounding)));
        continue;
      }
      // What was heard before stays before.
      FATHOM_RETURN_IF_ERROR(send(grouped.Finish()));
      FATHOM_RETURN_IF_ERROR(take(event));
    }
    FATHOM_RETURN_IF_ERROR(send(grouped.Finish()));
    read(*recording);
  }
  return absl::OkStatus();
}

absl::Status Validate(const ReplayOptions& options) {
  if (options.paths.empty()) {
    return absl::InvalidArgumentError("no recording named");
  }
  if (!(options.rate >= 0.0 && options.rate <= 1e6)) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "rate=%g must be in [0, 1e6]; 0 is flat out", options.rate));
  }
  if (options.from_now && !(options.rate > 0.0 && options.rate <= 1.0)) {
    return absl::InvalidArgumentError(
        "--from-now needs --rate in (0, 1]: faster than it happened, it would "
        "tell of the future");
  }
  const auto& depth_std_m = options.recording.depth_std_m;
  if (depth_std_m.has_value() && !(*depth_std_m > 0)) {
    return absl::InvalidArgumentError(
        absl::StrFormat("depth-std-m=%g must be above 0", *depth_std_m));
  }
  return absl::OkStatus();
}

std::string Describe(const std::map<std::string, std::uint64_t>& counts) {
  std::string text;
  for (const auto& [reason, count] : counts) {
    text += absl::StrFormat("%s%s %d", text.empty() ? "" : ", ", reason, count);
  }
  return text.empty() ? "none" : text;
}

// Recorded times as they are sent: shifted by the same span.
google::protobuf::Timestamp Shifted(const google::protobuf::Timestamp& time,
                                    Duration shift) {
  return client::ToProto(client::FromProto(time) + shift);
}

void PrintSummary(const ReplayContents& contents, const SinkState& state,
                  const ActivityCounts& counts, double seconds) {
  absl::FPrintF(
      stderr,
      "sent %d pings (%d soundings among them), %d reports on %d contacts; "
      "durable %d pings, %d reports; %.2f s, %.0f messages/s\n",
      contents.pings, contents.soundings, contents.reports, contents.contacts,
      state.pings.durable_sequence, state.reports.durable_sequence, seconds,
      seconds > 0 ? static_cast<double>(contents.messages()) / seconds : 0.0);
  absl::FPrintF(stderr, "passed over: %s\n", Describe(contents.passed_over));
  absl::FPrintF(stderr, "measurements rejected: %s\n",
                Describe(counts.rejects));
  absl::FPrintF(stderr, "reports rejected: %s\n",
                Describe(RejectCounts(state.reports)));
}

std::string ToJson(const ReplayOptions& options, const ReplayContents& contents,
                   const SinkState& state, const ActivityCounts& counts,
                   double seconds) {
  nlohmann::ordered_json json = {
      {"files", options.paths},
      {"activity_id", options.activity_id},
      {"source_id", options.link.source_id},
      {"start_time", FormatTime(*contents.first)},
      {"end_time", FormatTime(*contents.last)},
      {"soundings", contents.soundings},
      {"pings", contents.pings},
      {"contact_reports", contents.reports},
      {"contacts", contents.contacts},
      {"passed_over", contents.passed_over},
      {"pings_durable", state.pings.durable_sequence},
      {"reports_durable", state.reports.durable_sequence},
      {"measurements_accepted", counts.measurements_accepted},
      {"rejects", counts.rejects},
      {"report_rejects", RejectCounts(state.reports)},
      {"dropped", state.dropped},
      {"map_revision",
       std::max(state.pings.map_revision, state.reports.map_revision)},
      {"seconds", seconds}};
  if (contents.area.has_value()) {
    const SurveyArea& area = *contents.area;
    json["area"] = {{"south_west",
                     {{"latitude_deg", area.south_west.latitude_deg},
                      {"longitude_deg", area.south_west.longitude_deg}}},
                    {"north_extent_m", area.north_extent_m},
                    {"east_extent_m", area.east_extent_m},
                    {"cell_size_m", area.cell_size_m}};
  }
  return json.dump();
}

// Whether nothing asks the server before the messages, which can wait.
bool MayBeAway(const ReplayOptions& options, const ReplayContents& contents) {
  return !options.link.buffer.empty() &&
         !(contents.pings > 0 && options.start_activity);
}

// `client`: asked for what acks that a cut swallowed have counted; null: not.
absl::Status ReplayInto(const ReplayOptions& options,
                        const ReplayContents& contents,
                        const client::Client* client, MessageSink& sink) {
  const SteadyClock::time_point start = SteadyClock::now();
  const absl::Status end = DriveReplay(options, contents, sink);
  const double seconds =
      std::chrono::duration<double>(SteadyClock::now() - start).count();
  const SinkState state = sink.State();
  // What was dropped is told even if the end is not reached.
  if (state.dropped > 0) {
    absl::FPrintF(stderr, "dropped by a full buffer: %d messages\n",
                  state.dropped);
  }
  FATHOM_RETURN_IF_ERROR(end);
  ActivityCounts counts = {
      .measurements_accepted = state.pings.measurements_accepted,
      .rejects = RejectCounts(state.pings)};
  if (client != nullptr && state.pings.reconnects > 0) {
    FATHOM_ASSIGN_OR_RETURN(counts, CountsOf(*client, options.activity_id));
  }
  PrintSummary(contents, state, counts, seconds);
  if (options.json) {
    absl::PrintF("%s\n", ToJson(options, contents, state, counts, seconds));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<ReplayContents> SurveyRecordings(const ReplayOptions& options) {
  ReplayContents contents;
  Extent extent;
  std::unordered_set<std::string> contacts;
  const auto take = [&](RecordedEvent& event) {
    contents.first = std::min(contents.first.value_or(event.time), event.time);
    contents.last = std::max(contents.last.value_or(event.time), event.time);
    if (const v1::Ping* ping = std::get_if<v1::Ping>(&event.what)) {
      ++contents.pings;
      extent.Add(*ping);
    } else {
      ++contents.reports;
      if (contacts.size() < kMaxContacts) {
        contacts.insert(std::get<v1::ContactReport>(event.what).contact_id());
      }
    }
    return absl::OkStatus();
  };
  FATHOM_RETURN_IF_ERROR(ForEachMessage(
      options, take,
      [&](const Recording& recording) {
        for (const auto& [reason, count] : recording.passed_over()) {
          contents.passed_over[reason] += count;
        }
      },
      &contents.soundings));
  contents.contacts = contacts.size();
  contents.area = extent.Area(options.cell_size_m);
  return contents;
}

absl::Status DriveReplay(const ReplayOptions& options,
                         const ReplayContents& contents, MessageSink& sink) {
  if (!contents.first.has_value()) return sink.Finish();
  const SteadyClock::time_point start = SteadyClock::now();
  const Duration shift =
      options.from_now ? SystemClock().Now() - *contents.first : Duration(0);
  ProgressBar bar(contents.messages(), "messages", options.show_progress);
  std::uint64_t done = 0;
  const auto take = [&](RecordedEvent& event) -> absl::Status {
    if (options.rate > 0.0) {
      std::this_thread::sleep_until(
          start +
          std::chrono::duration_cast<SteadyClock::duration>(
              std::chrono::duration<double>(
                  ToSeconds(event.time - *contents.first) / options.rate)));
    }
    if (v1::Ping* ping = std::get_if<v1::Ping>(&event.what)) {
      *ping->mutable_time() = Shifted(ping->time(), shift);
      ping->set_activity_id(options.activity_id);
      if (options.water_level_m.has_value()) {
        v1::VerticalReference& zero = *ping->mutable_vertical_reference();
        zero.set_reference(v1::DEPTH_REFERENCE_WATER_SURFACE);
        zero.set_water_level_m(*options.water_level_m);
      }
      FATHOM_RETURN_IF_ERROR(sink.SendPing(*ping));
    } else {
      v1::ContactReport& report = std::get<v1::ContactReport>(event.what);
      *report.mutable_time() = Shifted(report.time(), shift);
      FATHOM_RETURN_IF_ERROR(sink.SendReport(report));
    }
    ++done;
    if (bar.Due()) bar.Update(done, RejectNote(sink.State()));
    return absl::OkStatus();
  };
  FATHOM_RETURN_IF_ERROR(ForEachMessage(
      options, take, [](const Recording&) {}, nullptr));
  FATHOM_RETURN_IF_ERROR(sink.Finish());
  bar.Finish(done, RejectNote(sink.State()));
  return absl::OkStatus();
}

absl::Status Replay(const ReplayOptions& options) {
  FATHOM_RETURN_IF_ERROR(Validate(options));
  FATHOM_ASSIGN_OR_RETURN(const ReplayContents contents,
                          SurveyRecordings(options));
  if (!contents.first.has_value()) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "the recording holds nothing that can be sent; passed over: %s%s",
        Describe(contents.passed_over),
        contents.passed_over.contains("no time")
            ? "; state --start-time, for it tells no time or no date"
            : ""));
  }
  if (options.link.server.empty()) {
    FATHOM_ASSIGN_OR_RETURN(
        const std::unique_ptr<RecordSink> sink,
        RecordSink::Open(options.pings_out, options.reports_out,
                         options.link.source_id));
    return ReplayInto(options, contents, nullptr, *sink);
  }
  FATHOM_ASSIGN_OR_RETURN(const std::unique_ptr<client::Client> client,
                          Connect(options.link, MayBeAway(options, contents)));
  const bool opens = contents.pings > 0 && options.start_activity;
  if (opens) {
    FATHOM_RETURN_IF_ERROR(
        OpenActivity(*client, {.id = options.activity_id,
                               .vehicle_id = options.vehicle_id,
                               .time = *contents.first,
                               .area = *contents.area,
                               .parameters = options.activity}));
  }
  FATHOM_ASSIGN_OR_RETURN(const std::unique_ptr<MessageSink> sink,
                          OpenSink(*client, options.link, options.rate > 0.0));
  FATHOM_RETURN_IF_ERROR(
      ReplayInto(options, contents, opens ? client.get() : nullptr, *sink));
  if (contents.pings > 0 && options.complete_activity) {
    return CompleteActivity(*client, options.activity_id);
  }
  return absl::OkStatus();
}

}  // namespace fathom::feeder
