#include "storage/gpkg_tables.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "absl/time/time.h"

namespace fathom::storage {
namespace {

constexpr std::uint32_t kWkbPoint = 1;
constexpr std::uint32_t kWkbLineString = 2;
constexpr double kSameDeg = 1e-9;
// The header of a GeoPackage blob without envelope, and of its WKB.
constexpr std::size_t kHeaderBytes = 8 + 5;

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

// Longitude first: GeoPackage's order.
void PutPoint(const map::GeodeticPoint& point, ByteWriter& writer) {
  writer.PutF64(point.longitude_deg);
  writer.PutF64(point.latitude_deg);
}

// Two geometries, coordinates from `head` on.
bool IsAlike(ByteSpan a, ByteSpan b, std::size_t head) {
  if (a.size() != b.size() ||
      !std::ranges::equal(a.first(head), b.first(head))) {
    return false;
  }
  ByteReader a_deg(a.subspan(head));
  ByteReader b_deg(b.subspan(head));
  while (a_deg.left() > 0) {
    if (!(std::abs(a_deg.GetF64() - b_deg.GetF64()) <= kSameDeg)) return false;
  }
  return true;
}

}  // namespace

const char kGeoPackageTables[] = R"sql(
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
)sql";

Bytes PointGeometry(const map::GeodeticPoint& point) {
  ByteWriter writer = StartGeometry(kWkbPoint);
  PutPoint(point, writer);
  return writer.Take();
}

Bytes LineGeometry(std::span<const map::GeodeticPoint> points) {
  ByteWriter writer = StartGeometry(kWkbLineString);
  writer.PutU32(static_cast<std::uint32_t>(points.size()));
  for (const map::GeodeticPoint& point : points) PutPoint(point, writer);
  return writer.Take();
}

bool IsPointGeometry(ByteSpan geometry, const map::GeodeticPoint& point) {
  return IsAlike(geometry, PointGeometry(point), kHeaderBytes);
}

bool IsLineGeometry(ByteSpan geometry,
                    std::span<const map::GeodeticPoint> points) {
  return IsAlike(geometry, LineGeometry(points), kHeaderBytes + 4);
}

std::string GeoPackageTime(Time time) {
  return absl::FormatTime("%Y-%m-%dT%H:%M:%E3SZ",
                          absl::FromUnixMicros(ToUnixMicros(time)),
                          absl::UTCTimeZone());
}

}  // namespace fathom::storage
