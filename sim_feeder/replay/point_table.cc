// A table of points that GDAL reads as a recording: soundings, the beams of
// multibeam pings, or positions of vessels.

#include <cpl_error.h>
#include <gdal_priv.h>
#include <ogrsf_frmts.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <chrono>
#include <cmath>
#include <initializer_list>
#include <utility>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "client/proto_time.h"
#include "sim_feeder/replay/nmea.h"
#include "sim_feeder/replay/recording.h"
#include "sim_feeder/replay/vessel_report.h"

namespace fathom::feeder {
namespace {

using Dataset = std::unique_ptr<GDALDataset>;
using Feature = std::unique_ptr<OGRFeature>;

constexpr int kNoColumn = -1;

std::string Lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) {
    return static_cast<char>(std::tolower(c));
  });
  return text;
}

// What the columns are, by their names.
struct Columns {
  int latitude = kNoColumn;
  int longitude = kNoColumn;
  int time = kNoColumn;
  int depth = kNoColumn;
  int std = kNoColumn;
  // Vessels.
  int id = kNoColumn;
  int course = kNoColumn;
  int speed = kNoColumn;
  // Multibeam: across the track to starboard, and below the sonar, metres.
  int ping = kNoColumn;
  int across = kNoColumn;
  int below = kNoColumn;
  int heading = kNoColumn;
};

// The first column whose name begins with one of the stems, in their order.
int Find(const OGRFeatureDefn& table,
         std::initializer_list<const char*> stems) {
  for (const std::string stem : stems) {
    for (int n = 0; n < table.GetFieldCount(); ++n) {
      const std::string name = Lower(table.GetFieldDefn(n)->GetNameRef());
      // A single letter is a whole name.
      if (stem.size() == 1 ? name == stem : name.starts_with(stem)) return n;
    }
  }
  return kNoColumn;
}

Columns FindColumns(const OGRFeatureDefn& table) {
  return {.latitude = Find(table, {"lat", "y", "field_2"}),
          .longitude = Find(table, {"lon", "x", "field_1"}),
          .time = Find(table, {"time", "utc", "date"}),
          .depth = Find(table, {"depth", "z", "elev", "height", "field_3"}),
          .std = Find(table, {"std", "sigma", "uncert", "tvu", "field_4"}),
          .id = Find(table, {"mmsi"}),
          .course = Find(table, {"cog", "course"}),
          .speed = Find(table, {"sog", "speed"}),
          .ping = Find(table, {"ping"}),
          .across = Find(table, {"across"}),
          .below = Find(table, {"depth_below"}),
          .heading = Find(table, {"heading"})};
}

std::optional<double> Number(const OGRFeature& row, int column) {
  if (column == kNoColumn || row.IsFieldSetAndNotNull(column) == 0) {
    return std::nullopt;
  }
  if (row.GetFieldDefnRef(column)->GetType() != OFTString) {
    const double value = row.GetFieldAsDouble(column);
    return std::isfinite(value) ? std::optional(value) : std::nullopt;
  }
  const std::string_view text = row.GetFieldAsString(column);
  double value = 0;
  const auto [end, error] =
      std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() ||
      !std::isfinite(value)) {
    return std::nullopt;
  }
  return value;
}

// RFC 3339 with or without an offset (without: UTC); a time of day, hhmmss, of
// the given day; seconds since 1970.
std::optional<Time> ParseAnyTime(const std::string& text,
                                 const std::optional<Time>& start) {
  for (const char* suffix : {"", "Z"}) {
    const absl::StatusOr<Time> time = ParseTime(text + suffix);
    if (time.ok()) return *time;
  }
  if (const std::optional<Duration> of_day = NmeaTimeOfDay(text);
      of_day.has_value() && start.has_value()) {
    return std::chrono::floor<std::chrono::days>(*start) + *of_day;
  }
  const std::optional<double> seconds = NmeaNumber(text);
  constexpr double kLeastS = 1e8;  // 1973: not a time of day.
  constexpr double kMostS = 1e10;  // 2286.
  if (!seconds.has_value() || *seconds < kLeastS || *seconds > kMostS) {
    return std::nullopt;
  }
  return Time(Duration(std::llround(1e6 * *seconds)));
}

std::optional<Time> TimeOf(const OGRFeature& row, int column,
                           const std::optional<Time>& start) {
  if (column == kNoColumn || row.IsFieldSetAndNotNull(column) == 0) {
    return std::nullopt;
  }
  if (row.GetFieldDefnRef(column)->GetType() != OFTDateTime) {
    return ParseAnyTime(row.GetFieldAsString(column), start);
  }
  int year = 0;
  int month = 0;
  int day = 0;
  int hour = 0;
  int minute = 0;
  int zone = 0;
  float second = 0;
  if (row.GetFieldAsDateTime(column, &year, &month, &day, &hour, &minute,
                             &second, &zone) == 0) {
    return std::nullopt;
  }
  const std::chrono::year_month_day date(
      std::chrono::year(year), std::chrono::month(static_cast<unsigned>(month)),
      std::chrono::day(static_cast<unsigned>(day)));
  if (!date.ok()) return std::nullopt;
  // 100 is UTC, each step a quarter of an hour; 0 and 1 are unknown and local,
  // taken for UTC.
  const int quarters = zone > 1 ? zone - 100 : 0;
  return Time(std::chrono::sys_days(date) + std::chrono::hours(hour) +
              std::chrono::minutes(minute - 15 * quarters)) +
         Duration(std::llround(1e6 * double{second}));
}

class PointTable final : public Recording {
 public:
  PointTable(const RecordingOptions& options, Dataset dataset, OGRLayer& layer)
      : options_(options),
        dataset_(std::move(dataset)),
        layer_(layer),
        columns_(FindColumns(*layer.GetLayerDefn())) {
    layer_.ResetReading();
  }

  // Errors: INVALID_ARGUMENT naming what is missing.
  absl::Status Check() const {
    const bool placed =
        layer_.GetGeomType() != wkbNone ||
        (columns_.latitude != kNoColumn && columns_.longitude != kNoColumn);
    const bool measured = columns_.id != kNoColumn || IsMultibeam() ||
                          columns_.depth != kNoColumn;
    if (placed && measured) return absl::OkStatus();
    std::string names;
    for (int n = 0; n < layer_.GetLayerDefn()->GetFieldCount(); ++n) {
      names += n == 0 ? "" : ", ";
      names += layer_.GetLayerDefn()->GetFieldDefn(n)->GetNameRef();
    }
    return absl::InvalidArgumentError(absl::StrFormat(
        "the table has no column for %s; it needs lat and lon (or a geometry) "
        "with depth, or with mmsi; its columns are: %s",
        placed ? "depth or mmsi" : "the place", names));
  }

  absl::StatusOr<std::optional<RecordedEvent>> Next() override {
    for (;;) {
      CPLErrorReset();
      Feature row(layer_.GetNextFeature());
      if (row == nullptr) {
        if (CPLGetLastErrorType() >= CE_Failure) {
          return absl::DataLossError(absl::StrFormat(
              "cannot be read after row %d: %s", done_, CPLGetLastErrorMsg()));
        }
        return std::exchange(ping_, std::nullopt);
      }
      ++done_;
      std::optional<RecordedEvent> event = Take(*row);
      if (event.has_value()) return event;
    }
  }

 private:
  bool IsMultibeam() const {
    return columns_.across != kNoColumn && columns_.below != kNoColumn &&
           columns_.ping != kNoColumn;
  }

  std::optional<RecordedEvent> Take(const OGRFeature& row) {
    const std::optional<map::GeodeticPoint> place = PlaceOf(row);
    if (!place.has_value()) {
      PassOver("no position");
      return std::nullopt;
    }
    std::optional<Time> time = TimeOf(row, columns_.time, options_.start_time);
    if (!time.has_value() && options_.start_time.has_value()) {
      time = *options_.start_time +
             Duration(std::llround(1e6 * options_.line_interval_s *
                                   static_cast<double>(done_ - 1)));
    }
    if (!time.has_value()) {
      PassOver("no time");
      return std::nullopt;
    }
    if (columns_.id != kNoColumn) return TakeVessel(row, *place, *time);
    if (IsMultibeam()) return TakeBeam(row, *place, *time);
    const std::optional<double> value = Number(row, columns_.depth);
    if (!value.has_value()) {
      PassOver("no depth");
      return std::nullopt;
    }
    const double depth_m = options_.positive_up ? -*value : *value;
    if (!IsDepth(depth_m)) {
      PassOver("depth out of range");
      return std::nullopt;
    }
    return RecordedEvent{
        .time = *time,
        .what = Sounding{
            .place = *place, .depth_m = depth_m, .std_m = StdOf(row, depth_m)}};
  }

  std::optional<map::GeodeticPoint> PlaceOf(const OGRFeature& row) const {
    map::GeodeticPoint place;
    const OGRGeometry* geometry = row.GetGeometryRef();
    if (geometry != nullptr &&
        wkbFlatten(geometry->getGeometryType()) == wkbPoint) {
      // GeoJSON, GeoPackage and shapefile give x east and y north.
      place = {.latitude_deg = geometry->toPoint()->getY(),
               .longitude_deg = geometry->toPoint()->getX()};
    } else {
      const std::optional<double> latitude = Number(row, columns_.latitude);
      const std::optional<double> longitude = Number(row, columns_.longitude);
      if (!latitude.has_value() || !longitude.has_value()) return std::nullopt;
      place = {.latitude_deg = *latitude, .longitude_deg = *longitude};
    }
    if (!map::ValidateGeodetic(place).ok()) return std::nullopt;
    return place;
  }

  double StdOf(const OGRFeature& row, double depth_m) const {
    const double fallback = options_.depth_std_m.value_or(Order1bStdM(depth_m));
    const double std_m = Number(row, columns_.std).value_or(fallback);
    if (std_m <= 0) return fallback;
    return options_.uncertainty_95 && columns_.std != kNoColumn ? std_m / 1.96
                                                                : std_m;
  }

  std::optional<RecordedEvent> TakeVessel(const OGRFeature& row,
                                          const map::GeodeticPoint& place,
                                          Time time) {
    const std::optional<double> mmsi = Number(row, columns_.id);
    if (!mmsi.has_value() || *mmsi < 1 || *mmsi > 999'999'999) {
      PassOver("no mmsi");
      return std::nullopt;
    }
    AisPosition position = {.place = place,
                            .speed_kn = Number(row, columns_.speed),
                            .course_deg = Number(row, columns_.course)};
    // As AIS says "not available".
    if (position.speed_kn.value_or(0) > 102.25) position.speed_kn.reset();
    if (position.course_deg.value_or(0) >= 360) position.course_deg.reset();
    return RecordedEvent{.time = time,
                         .what = FixOf(static_cast<std::uint32_t>(*mmsi),
                                       position, std::nullopt, time)};
  }

  // Beams of one ping stand together; a ping is whole when the next begins.
  std::optional<RecordedEvent> TakeBeam(const OGRFeature& row,
                                        const map::GeodeticPoint& place,
                                        Time time) {
    const std::optional<double> number = Number(row, columns_.ping);
    const std::optional<double> across_m = Number(row, columns_.across);
    const std::optional<double> below_m = Number(row, columns_.below);
    if (!number.has_value() || !across_m.has_value() || !below_m.has_value() ||
        *across_m == 0) {
      PassOver("no beam");
      return std::nullopt;
    }
    const double depth_m = *below_m + options_.transducer_depth_m;
    if (!IsDepth(depth_m)) {
      PassOver("depth out of range");
      return std::nullopt;
    }
    std::optional<RecordedEvent> whole;
    if (!ping_.has_value() || ping_number_ != *number) {
      whole =
          std::exchange(ping_, RecordedEvent{.time = time, .what = v1::Ping()});
      ping_number_ = *number;
      v1::Ping& begun = std::get<v1::Ping>(ping_->what);
      *begun.mutable_time() = client::ToProto(time);
      v1::VehiclePose& pose = *begun.mutable_pose();
      pose.mutable_position()->set_latitude_deg(place.latitude_deg);
      pose.mutable_position()->set_longitude_deg(place.longitude_deg);
      pose.set_depth_m(options_.transducer_depth_m);
      pose.set_heading_deg(
          std::fmod(Number(row, columns_.heading).value_or(0), 360.0));
    }
    v1::Ping& ping = std::get<v1::Ping>(ping_->what);
    ping.add_range_m(static_cast<float>(std::fabs(*across_m)));
    ping.add_bearing_deg(*across_m > 0 ? 90.0f : -90.0f);
    ping.add_depth_m(static_cast<float>(depth_m));
    ping.add_std_m(static_cast<float>(StdOf(row, depth_m)));
    return whole;
  }

  const RecordingOptions options_;
  const Dataset dataset_;
  OGRLayer& layer_;
  const Columns columns_;
  std::uint64_t done_ = 0;
  // The ping whose beams are being read.
  std::optional<RecordedEvent> ping_;
  double ping_number_ = 0;
};

}  // namespace

absl::StatusOr<std::unique_ptr<Recording>> OpenPointTable(
    const std::string& path, const RecordingOptions& options) {
  GDALAllRegister();
  // GDAL tells text tables by their names' end alone.
  std::string name = path;
  for (const char* text : {".csv", ".csv.gz", ".xyz", ".xyz.gz", ".txt"}) {
    if (Lower(path).ends_with(text)) name = "CSV:" + path;
  }
  CPLPushErrorHandler(CPLQuietErrorHandler);
  Dataset dataset(GDALDataset::Open(name.c_str(), GDAL_OF_VECTOR));
  CPLPopErrorHandler();
  if (dataset == nullptr || dataset->GetLayerCount() < 1) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "%s is no table of points that GDAL reads (CSV, XYZ, GeoJSON, "
        "GeoPackage, ...) and holds no NMEA sentence",
        path));
  }
  OGRLayer& layer = *dataset->GetLayer(0);
  auto table = std::make_unique<PointTable>(options, std::move(dataset), layer);
  const absl::Status usable = table->Check();
  if (!usable.ok()) {
    return absl::InvalidArgumentError(
        absl::StrFormat("%s: %s", path, usable.message()));
  }
  return table;
}

}  // namespace fathom::feeder
