#include "storage/geopackage.h"

#include <array>
#include <vector>

#include "absl/strings/str_format.h"
#include "absl/time/time.h"
#include "base/status_macros.h"
#include "storage/bytes.h"
#include "storage/draft_file.h"
#include "storage/history_reader.h"

namespace fathom::storage {
namespace {

// OGC 12-128r18: application_id "GPKG", version 1.3.
constexpr char kTables[] = R"sql(
PRAGMA application_id = 1196444487;
PRAGMA user_version = 10300;
CREATE TABLE gpkg_spatial_ref_sys (
  srs_name TEXT NOT NULL, srs_id INTEGER NOT NULL PRIMARY KEY,
  organization TEXT NOT NULL, organization_coordsys_id INTEGER NOT NULL,
  definition TEXT NOT NULL, description TEXT);
INSERT INTO gpkg_spatial_ref_sys VALUES
  ('Undefined Cartesian', -1, 'NONE', -1, 'undefined', NULL),
  ('Undefined geographic', 0, 'NONE', 0, 'undefined', NULL),
  ('WGS 84', 4326, 'EPSG', 4326, 'GEOGCS["WGS 84",DATUM["WGS_1984",'
   || 'SPHEROID["WGS 84",6378137,298.257223563,AUTHORITY["EPSG","7030"]],'
   || 'AUTHORITY["EPSG","6326"]],PRIMEM["Greenwich",0,'
   || 'AUTHORITY["EPSG","8901"]],UNIT["degree",0.0174532925199433,'
   || 'AUTHORITY["EPSG","9122"]],AUTHORITY["EPSG","4326"]]',
   'longitude, latitude, degrees');
CREATE TABLE gpkg_contents (
  table_name TEXT NOT NULL PRIMARY KEY, data_type TEXT NOT NULL,
  identifier TEXT UNIQUE, description TEXT DEFAULT '',
  last_change DATETIME NOT NULL DEFAULT
    (strftime('%Y-%m-%dT%H:%M:%fZ', 'now')),
  min_x DOUBLE, min_y DOUBLE, max_x DOUBLE, max_y DOUBLE,
  srs_id INTEGER REFERENCES gpkg_spatial_ref_sys(srs_id));
CREATE TABLE gpkg_geometry_columns (
  table_name TEXT NOT NULL PRIMARY KEY, column_name TEXT NOT NULL,
  geometry_type_name TEXT NOT NULL, srs_id INTEGER NOT NULL,
  z TINYINT NOT NULL, m TINYINT NOT NULL,
  CONSTRAINT uk_gc_table_name UNIQUE (table_name));
CREATE TABLE contact_points (
  fid INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, geom POINT,
  source_id TEXT, contact_id TEXT, time DATETIME, contact_class INTEGER,
  status INTEGER, velocity_north_m_s DOUBLE, velocity_east_m_s DOUBLE);
CREATE TABLE contact_tracks (
  fid INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, geom LINESTRING,
  source_id TEXT, contact_id TEXT, start_time DATETIME, end_time DATETIME,
  estimates INTEGER);
INSERT INTO gpkg_contents (table_name, data_type, identifier, description,
  srs_id) VALUES
  ('contact_points', 'features', 'contact_points',
   'what was believed of a contact after each report', 4326),
  ('contact_tracks', 'features', 'contact_tracks',
   'a line through each contact''s estimates', 4326);
INSERT INTO gpkg_geometry_columns VALUES
  ('contact_points', 'geom', 'POINT', 4326, 0, 0),
  ('contact_tracks', 'geom', 'LINESTRING', 4326, 0, 0);
)sql";

constexpr std::uint32_t kWkbPoint = 1;
constexpr std::uint32_t kWkbLineString = 2;

// Longitude first: GeoPackage's order.
using LonLat = std::array<double, 2>;

// The header of a GeoPackage blob without envelope, and of its WKB.
ByteWriter StartGeometry(std::uint32_t type) {
  ByteWriter writer;
  writer.PutU8('G');
  writer.PutU8('P');
  writer.PutU8(0);     // Version.
  writer.PutU8(0x01);  // Little-endian, no envelope.
  writer.PutU32(4326);
  writer.PutU8(1);  // WKB: little-endian.
  writer.PutU32(type);
  return writer;
}

Bytes PointBlob(const LonLat& point) {
  ByteWriter writer = StartGeometry(kWkbPoint);
  for (const double value : point) writer.PutF64(value);
  return writer.Take();
}

Bytes LineBlob(const std::vector<LonLat>& points) {
  ByteWriter writer = StartGeometry(kWkbLineString);
  writer.PutU32(static_cast<std::uint32_t>(points.size()));
  for (const LonLat& point : points) {
    for (const double value : point) writer.PutF64(value);
  }
  return writer.Take();
}

std::string TimeText(std::int64_t unix_us) {
  return absl::FormatTime("%Y-%m-%dT%H:%M:%E3SZ", absl::FromUnixMicros(unix_us),
                          absl::UTCTimeZone());
}

class Exporter {
 public:
  explicit Exporter(Connection& out) : out_(out) {}

  absl::StatusOr<ExportedContacts> Run(
      Connection& mission, const std::vector<ContactHistoryRow>& replayed) {
    FATHOM_RETURN_IF_ERROR(out_.Execute(kTables));
    FATHOM_ASSIGN_OR_RETURN(Transaction transaction, Transaction::Begin(out_));
    FATHOM_ASSIGN_OR_RETURN(
        add_point_,
        out_.Prepare("INSERT INTO contact_points (geom, source_id, contact_id, "
                     "time, contact_class, status, velocity_north_m_s, "
                     "velocity_east_m_s) VALUES (?, ?, ?, ?, ?, ?, ?, ?)"));
    FATHOM_ASSIGN_OR_RETURN(
        add_track_,
        out_.Prepare("INSERT INTO contact_tracks (geom, source_id, contact_id, "
                     "start_time, end_time, estimates) VALUES (?, ?, ?, ?, ?, "
                     "?)"));
    FATHOM_RETURN_IF_ERROR(ReadWholeHistory(
        mission, replayed,
        [this](const ContactHistoryRow& row) { return Add(row.estimate); },
        [](const absl::Status& damage) { return damage; }));
    FATHOM_RETURN_IF_ERROR(EndTrack());
    FATHOM_RETURN_IF_ERROR(transaction.Commit());
    return counts_;
  }

 private:
  absl::Status Add(const map::ContactEstimate& estimate) {
    if (estimate.key != key_) FATHOM_RETURN_IF_ERROR(EndTrack());
    key_ = estimate.key;
    end_us_ = ToUnixMicros(estimate.time);
    if (points_.empty()) start_us_ = end_us_;
    const map::GeodeticPoint position = estimate.Position();
    const LonLat point = {position.longitude_deg, position.latitude_deg};
    const Bytes geometry = PointBlob(point);
    const std::string time = TimeText(end_us_);
    add_point_.BindBlob(0, geometry);
    add_point_.BindText(1, key_.source.value);
    add_point_.BindText(2, key_.contact.value);
    add_point_.BindText(3, time);
    add_point_.BindInt(4, static_cast<std::int64_t>(estimate.contact_class));
    add_point_.BindInt(5, static_cast<std::int64_t>(estimate.status));
    add_point_.BindReal(6, estimate.x(2));
    add_point_.BindReal(7, estimate.x(3));
    points_.push_back(point);
    ++counts_.points;
    return add_point_.Run();
  }

  absl::Status EndTrack() {
    if (points_.size() < 2) {
      points_.clear();
      return absl::OkStatus();
    }
    const Bytes geometry = LineBlob(points_);
    const std::string start = TimeText(start_us_);
    const std::string end = TimeText(end_us_);
    add_track_.BindBlob(0, geometry);
    add_track_.BindText(1, key_.source.value);
    add_track_.BindText(2, key_.contact.value);
    add_track_.BindText(3, start);
    add_track_.BindText(4, end);
    add_track_.BindUint(5, points_.size());
    points_.clear();
    ++counts_.tracks;
    return add_track_.Run();
  }

  Connection& out_;
  Statement add_point_;
  Statement add_track_;
  ExportedContacts counts_;
  map::ContactKey key_;
  std::int64_t start_us_ = 0;
  std::int64_t end_us_ = 0;
  std::vector<LonLat> points_;
};

}  // namespace

absl::StatusOr<ExportedContacts> ExportContacts(
    Connection& mission, const std::vector<ContactHistoryRow>& replayed,
    const std::string& path) {
  FATHOM_RETURN_IF_ERROR(CheckAbsent(path));
  DraftFile draft(path);
  ExportedContacts counts;
  {
    FATHOM_ASSIGN_OR_RETURN(
        Connection out,
        Connection::Open(draft.path(), Connection::Mode::kCreate));
    FATHOM_ASSIGN_OR_RETURN(counts, Exporter(out).Run(mission, replayed));
  }
  FATHOM_RETURN_IF_ERROR(draft.Publish());
  return counts;
}

}  // namespace fathom::storage
