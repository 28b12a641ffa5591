#include "storage/history_features.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "storage/gpkg_tables.h"
#include "storage/history_codec.h"

namespace fathom::storage {
namespace {

// Without the AUTOINCREMENT that GeoPackage asks for: a block's id is given,
// and a table of last ids would be one more page a commit. GeoPackage's column
// types are not those of a STRICT table. Where a table is named as one of
// attributes, GDAL shows no other that has no geometry.
constexpr char kTables[] = R"sql(
CREATE TABLE tracks (
  fid INTEGER PRIMARY KEY, geom LINESTRING,
  contact_number INTEGER NOT NULL, source_id TEXT NOT NULL,
  contact_id TEXT NOT NULL, start_time DATETIME NOT NULL,
  end_time DATETIME NOT NULL, estimates INTEGER NOT NULL);
CREATE TABLE track_points (
  fid INTEGER PRIMARY KEY, geom POINT NOT NULL,
  contact_number INTEGER NOT NULL, source_id TEXT NOT NULL,
  contact_id TEXT NOT NULL, time DATETIME NOT NULL,
  contact_class INTEGER NOT NULL, status INTEGER NOT NULL,
  velocity_north_m_s DOUBLE NOT NULL, velocity_east_m_s DOUBLE NOT NULL,
  speed_m_s DOUBLE NOT NULL, course_deg DOUBLE NOT NULL,
  std_north_m DOUBLE NOT NULL, std_east_m DOUBLE NOT NULL);
INSERT INTO gpkg_contents (table_name, data_type, identifier, description,
  srs_id) VALUES
  ('tracks', 'features', 'tracks',
   'a line through each block of a contact''s estimates', 4326),
  ('track_points', 'features', 'track_points',
   'the last estimate of each block', 4326),
  ('contact', 'attributes', 'contact', 'every contact ever reported', NULL);
INSERT INTO gpkg_geometry_columns VALUES
  ('tracks', 'geom', 'LINESTRING', 4326, 0, 0),
  ('track_points', 'geom', 'POINT', 4326, 0, 0);
)sql";

constexpr char kInsertTrack[] =
    "INSERT INTO tracks (fid, contact_number, start_time, end_time, estimates, "
    "geom, source_id, contact_id) SELECT ?1, contact_number, ?3, ?4, ?5, ?6, "
    "source_id, contact_id FROM contact WHERE contact_number = ?2";

constexpr char kInsertPoint[] =
    "INSERT INTO track_points (fid, contact_number, time, contact_class, "
    "status, velocity_north_m_s, velocity_east_m_s, geom, speed_m_s, "
    "course_deg, std_north_m, std_east_m, source_id, contact_id) SELECT ?1, "
    "contact_number, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12, source_id, "
    "contact_id FROM contact WHERE contact_number = ?2";

// What another machine's mathematics library may have made otherwise is left
// out: speed and course follow from the velocity.
constexpr char kMatch[] =
    "SELECT t.geom, p.geom FROM tracks AS t JOIN track_points AS p USING (fid) "
    "JOIN contact AS c ON c.contact_number = ?2 WHERE fid = ?1 AND "
    "(t.contact_number, t.source_id, t.contact_id) = (c.contact_number, "
    "c.source_id, c.contact_id) AND (p.contact_number, p.source_id, "
    "p.contact_id) = (c.contact_number, c.source_id, c.contact_id) AND "
    "(t.start_time, t.end_time, t.estimates) = (?3, ?4, ?5) AND (p.time, "
    "p.contact_class, p.status, p.velocity_north_m_s, p.velocity_east_m_s, "
    "p.std_north_m, p.std_east_m) = (?4, ?6, ?7, ?8, ?9, ?10, ?11)";

double StdOf(double variance) { return std::sqrt(std::max(0.0, variance)); }

// 0: north; 90: east; within [0, 360).
double CourseDeg(double north_m_s, double east_m_s) {
  const double deg = std::atan2(east_m_s, north_m_s) * 180 / std::numbers::pi;
  return deg < 0 ? deg + 360 : deg;
}

}  // namespace

absl::Status CreateFeatureTables(Connection& connection) {
  FATHOM_RETURN_IF_ERROR(connection.Execute(kGeoPackageTables));
  return connection.Execute(kTables);
}

absl::Status FillFeatureTables(
    Connection& connection,
    const std::function<void(std::uint64_t estimates)>& done) {
  HistoryFeatures features(connection);
  FATHOM_ASSIGN_OR_RETURN(
      Statement select,
      connection.Prepare("SELECT block_id, contact_number, content FROM "
                         "contact_history ORDER BY block_id"));
  while (true) {
    FATHOM_ASSIGN_OR_RETURN(const bool more, select.Step());
    if (!more) return absl::OkStatus();
    const std::int64_t block_id = select.ColumnInt(0);
    const std::int64_t number = select.ColumnInt(1);
    const auto rows = DecodeHistory(select.ColumnBlob(2), number,
                                    WhatOfBlock(number, block_id));
    // Served until now, and from now on, but for its contact's history.
    if (!rows.ok()) continue;
    FATHOM_RETURN_IF_ERROR(
        features.Insert(block_id, number, *rows, PositionsOf(*rows)));
    done(rows->size());
  }
}

absl::Status HistoryFeatures::Prepare(std::optional<Statement>& statement,
                                      const char* sql) {
  if (statement.has_value()) return absl::OkStatus();
  FATHOM_ASSIGN_OR_RETURN(statement, connection_->Prepare(sql));
  return absl::OkStatus();
}

absl::Status HistoryFeatures::Insert(
    std::int64_t block_id, std::int64_t contact_number,
    std::span<const ContactHistoryRow> rows,
    std::span<const map::GeodeticPoint> positions) {
  FATHOM_RETURN_IF_ERROR(Prepare(insert_track_, kInsertTrack));
  FATHOM_RETURN_IF_ERROR(Prepare(insert_point_, kInsertPoint));
  const map::ContactEstimate& last = rows.back().estimate;
  const std::string start = GeoPackageTime(rows.front().estimate.time);
  const std::string end = GeoPackageTime(last.time);
  const Bytes line = positions.size() > 1 ? LineGeometry(positions) : Bytes();
  insert_track_->BindInt(0, block_id);
  insert_track_->BindInt(1, contact_number);
  insert_track_->BindText(2, start);
  insert_track_->BindText(3, end);
  insert_track_->BindUint(4, rows.size());
  if (line.empty()) {
    insert_track_->BindNull(5);
  } else {
    insert_track_->BindBlob(5, line);
  }
  FATHOM_RETURN_IF_ERROR(insert_track_->Run());
  const double north_m_s = last.x(2);
  const double east_m_s = last.x(3);
  const Bytes point = PointGeometry(positions.back());
  insert_point_->BindInt(0, block_id);
  insert_point_->BindInt(1, contact_number);
  insert_point_->BindText(2, end);
  insert_point_->BindInt(3, static_cast<std::int64_t>(last.contact_class));
  insert_point_->BindInt(4, static_cast<std::int64_t>(last.status));
  insert_point_->BindReal(5, north_m_s);
  insert_point_->BindReal(6, east_m_s);
  insert_point_->BindBlob(7, point);
  insert_point_->BindReal(8, std::hypot(north_m_s, east_m_s));
  insert_point_->BindReal(9, CourseDeg(north_m_s, east_m_s));
  insert_point_->BindReal(10, StdOf(last.P(0, 0)));
  insert_point_->BindReal(11, StdOf(last.P(1, 1)));
  return insert_point_->Run();
}

absl::Status HistoryFeatures::Delete(std::int64_t block_id) {
  FATHOM_RETURN_IF_ERROR(
      Prepare(delete_track_, "DELETE FROM tracks WHERE fid = ?"));
  FATHOM_RETURN_IF_ERROR(
      Prepare(delete_point_, "DELETE FROM track_points WHERE fid = ?"));
  delete_track_->BindInt(0, block_id);
  FATHOM_RETURN_IF_ERROR(delete_track_->Run());
  delete_point_->BindInt(0, block_id);
  return delete_point_->Run();
}

absl::StatusOr<bool> HistoryFeatures::Match(
    std::int64_t block_id, std::int64_t contact_number,
    std::span<const ContactHistoryRow> rows) {
  FATHOM_RETURN_IF_ERROR(Prepare(match_, kMatch));
  const map::ContactEstimate& last = rows.back().estimate;
  const std::string start = GeoPackageTime(rows.front().estimate.time);
  const std::string end = GeoPackageTime(last.time);
  match_->BindInt(0, block_id);
  match_->BindInt(1, contact_number);
  match_->BindText(2, start);
  match_->BindText(3, end);
  match_->BindUint(4, rows.size());
  match_->BindInt(5, static_cast<std::int64_t>(last.contact_class));
  match_->BindInt(6, static_cast<std::int64_t>(last.status));
  match_->BindReal(7, last.x(2));
  match_->BindReal(8, last.x(3));
  match_->BindReal(9, StdOf(last.P(0, 0)));
  match_->BindReal(10, StdOf(last.P(1, 1)));
  const absl::StatusOr<bool> row = match_->Step();
  bool match = row.ok() && *row;
  if (match) {
    const std::vector<map::GeodeticPoint> positions = PositionsOf(rows);
    match = positions.size() == 1
                ? match_->ColumnIsNull(0)
                : IsLineGeometry(match_->ColumnBlob(0), positions);
    match = match && IsPointGeometry(match_->ColumnBlob(1), positions.back());
  }
  match_->Reset();
  FATHOM_RETURN_IF_ERROR(row.status());
  return match;
}

}  // namespace fathom::storage
