// A log of NMEA 0183 sentences as a recording.

#include <cpl_conv.h>
#include <cpl_vsi.h>

#include <chrono>
#include <cmath>
#include <unordered_map>
#include <utility>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "sim_feeder/replay/ais.h"
#include "sim_feeder/replay/nmea.h"
#include "sim_feeder/replay/recording.h"
#include "sim_feeder/replay/vessel_report.h"

namespace fathom::feeder {
namespace {

using File = std::unique_ptr<VSILFILE, int (*)(VSILFILE*)>;

// How old a position may be that a depth is taken at. Five seconds at 5 m/s
// are a cell of 25 m.
constexpr std::chrono::seconds kFixValid{5};
// A time of day that is earlier than the last by more than this is of the next
// day.
constexpr std::chrono::hours kHalfDay{12};
// Ships whose kind is remembered; the next are of unknown class.
constexpr std::size_t kMaxShips = 100'000;

class NmeaLog final : public Recording {
 public:
  NmeaLog(const RecordingOptions& options, File file)
      : options_(options), file_(std::move(file)) {
    if (options.start_time.has_value()) {
      day_ = std::chrono::floor<std::chrono::days>(*options.start_time);
    }
  }

  absl::StatusOr<std::optional<RecordedEvent>> Next() override {
    while (const char* line =
               CPLReadLine2L(file_.get(), kMaxLineLength, nullptr)) {
      ++lines_;
      if (IsNmeaComment(line)) continue;
      const absl::StatusOr<NmeaSentence> sentence = ParseNmea(line);
      if (!sentence.ok()) {
        PassOver(sentence.status());
        continue;
      }
      if (sentence->tag_time.has_value()) now_ = sentence->tag_time;
      std::optional<RecordedEvent> event = Take(*sentence);
      if (event.has_value()) return event;
    }
    if (VSIFEofL(file_.get()) == 0) {
      return absl::DataLossError(
          absl::StrFormat("cannot be read after line %d", lines_));
    }
    return std::optional<RecordedEvent>();
  }

 private:
  static constexpr int kMaxLineLength = 65'536;

  // Absent: nothing to tell yet; counted if it never will be.
  std::optional<RecordedEvent> Take(const NmeaSentence& sentence) {
    const std::string_view type = sentence.type();
    if (type == "VDM" || type == "VDO") return TakeAis(sentence);
    if (type == "ZDA") {
      TakeZda(sentence);
    } else if (type == "RMC") {
      TakeRmc(sentence);
    } else if (type == "GGA") {
      TakeFix(sentence, 0, 1, sentence.field(5) != "0");
    } else if (type == "GLL") {
      TakeFix(sentence, 4, 0, sentence.field(5) != "V");
    } else if (type == "DBT") {
      return TakeDepth(NmeaNumber(sentence.field(2)),
                       options_.transducer_depth_m);
    } else if (type == "DPT") {
      // A positive offset is that of the waterline, a negative one the keel's.
      const double offset_m = NmeaNumber(sentence.field(1)).value_or(0);
      return TakeDepth(NmeaNumber(sentence.field(0)),
                       offset_m > 0 ? offset_m : options_.transducer_depth_m);
    } else {
      PassOver("other sentence");
    }
    return std::nullopt;
  }

  void TakeRmc(const NmeaSentence& sentence) {
    if (const std::optional<Time> date = NmeaDate(sentence.field(8))) {
      day_ = *date;
    }
    TakeFix(sentence, 0, 2, sentence.field(1) == "A");
  }

  void TakeZda(const NmeaSentence& sentence) {
    const std::optional<double> year = NmeaNumber(sentence.field(3));
    const std::optional<double> month = NmeaNumber(sentence.field(2));
    const std::optional<double> day = NmeaNumber(sentence.field(1));
    if (year.has_value() && month.has_value() && day.has_value()) {
      const std::chrono::year_month_day date(
          std::chrono::year(static_cast<int>(*year)),
          std::chrono::month(static_cast<unsigned>(*month)),
          std::chrono::day(static_cast<unsigned>(*day)));
      if (date.ok() && *year >= 1970 && *year < 2100) {
        day_ = std::chrono::sys_days(date);
      }
    }
    SetTimeOfDay(sentence.field(0));
  }

  // A position whose time is field `time_at` and whose four fields of the place
  // begin at `place_at`.
  void TakeFix(const NmeaSentence& sentence, std::size_t time_at,
               std::size_t place_at, bool valid) {
    SetTimeOfDay(sentence.field(time_at));
    const std::optional<map::GeodeticPoint> place =
        NmeaPlace(sentence.field(place_at), sentence.field(place_at + 1),
                  sentence.field(place_at + 2), sentence.field(place_at + 3));
    if (!valid || !place.has_value()) {
      PassOver("no fix");
      return;
    }
    place_ = place;
    fixed_at_ = now_;
  }

  void SetTimeOfDay(std::string_view field) {
    const std::optional<Duration> time = NmeaTimeOfDay(field);
    if (!time.has_value() || !day_.has_value()) return;
    Time told = *day_ + *time;
    if (own_time_.has_value() && *own_time_ - told > kHalfDay) {
      *day_ += std::chrono::days(1);
      told += std::chrono::days(1);
    }
    own_time_ = told;
    now_ = told;
  }

  std::optional<RecordedEvent> TakeDepth(const std::optional<double>& depth_m,
                                         double below_surface_m) {
    if (!depth_m.has_value() || *depth_m <= 0) {
      PassOver("no depth");
      return std::nullopt;
    }
    if (!now_.has_value()) {
      PassOver("no time");
      return std::nullopt;
    }
    if (!place_.has_value() || *now_ - fixed_at_.value_or(*now_) > kFixValid) {
      PassOver("no position");
      return std::nullopt;
    }
    const double below_m = *depth_m + below_surface_m;
    if (!IsDepth(below_m)) {
      PassOver("depth out of range");
      return std::nullopt;
    }
    return RecordedEvent{
        .time = *now_,
        .what = Sounding{
            .place = *place_,
            .depth_m = below_m,
            .std_m = options_.depth_std_m.value_or(Order1bStdM(below_m))}};
  }

  std::optional<RecordedEvent> TakeAis(const NmeaSentence& sentence) {
    const absl::StatusOr<std::optional<AisMessage>> message =
        ais_.Take(sentence);
    if (!message.ok()) {
      PassOver(message.status());
      return std::nullopt;
    }
    if (!message->has_value()) return std::nullopt;
    const AisMessage& told = **message;
    if (told.ship.has_value()) Remember(told.mmsi, *told.ship);
    if (!told.position.has_value()) {
      const bool has_place = told.type <= 3 || told.type == 18 ||
                             told.type == 19 || told.type == 27;
      PassOver(has_place               ? "position not available"
               : told.ship.has_value() ? "what the ship is"
                                       : "other message");
      return std::nullopt;
    }
    // A log without times: one line after the other.
    Time time;
    if (now_.has_value()) {
      time = TimeOfFix(*now_, told.position->utc_second);
    } else if (options_.start_time.has_value()) {
      time = *options_.start_time +
             Duration(std::llround(1e6 * options_.line_interval_s *
                                   static_cast<double>(lines_ - 1)));
    } else {
      PassOver("no time");
      return std::nullopt;
    }
    const auto ship = ships_.find(told.mmsi);
    return RecordedEvent{
        .time = time,
        .what = FixOf(
            told.mmsi, *told.position,
            ship == ships_.end() ? std::optional<AisShip>() : ship->second,
            time)};
  }

  void Remember(std::uint32_t mmsi, const AisShip& ship) {
    if (ships_.size() < kMaxShips || ships_.contains(mmsi)) {
      ships_[mmsi] = ship;
    }
  }

  const RecordingOptions options_;
  const File file_;
  std::uint64_t lines_ = 0;

  AisAssembler ais_;
  std::unordered_map<std::uint32_t, AisShip> ships_;
  std::optional<Time> day_;
  // Of the last time of day, and of whatever told a time last.
  std::optional<Time> own_time_;
  std::optional<Time> now_;
  std::optional<map::GeodeticPoint> place_;
  std::optional<Time> fixed_at_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<Recording>> OpenNmeaLog(
    const std::string& path, const RecordingOptions& options) {
  File file(VSIFOpenL(path.c_str(), "rb"), VSIFCloseL);
  if (file == nullptr) {
    return absl::NotFoundError(absl::StrFormat("cannot read %s", path));
  }
  return std::make_unique<NmeaLog>(options, std::move(file));
}

}  // namespace fathom::feeder
