// What OGC 12-128r18 (GeoPackage 1.3) wants of tables and geometries, for the
// mission file's own layers (history_features.h) and for an export
// (geopackage.h). Positions are WGS 84 longitude and latitude, degrees
// (EPSG:4326). Thread-safe.

#ifndef FATHOM_STORAGE_GPKG_TABLES_H_
#define FATHOM_STORAGE_GPKG_TABLES_H_

#include <span>
#include <string>

#include "absl/status/statusor.h"
#include "base/time.h"
#include "map/geodesy/points.h"
#include "storage/bytes.h"

namespace fathom::storage {

// SQL that makes gpkg_spatial_ref_sys with its three rows, gpkg_contents and
// gpkg_geometry_columns, both empty: the tables that every one has.
extern const char kGeoPackageTables[];

// Geometries as GeoPackage keeps them, little-endian, without envelope.
// REQUIRES: a line has at least two points.
Bytes PointGeometry(const map::GeodeticPoint& point);
Bytes LineGeometry(std::span<const map::GeodeticPoint> points);

// Whether these made the geometry of points that are the same to 1e-9 degrees
// (0.1 mm): another machine's mathematics library may have told them.
bool IsPointGeometry(ByteSpan geometry, const map::GeodeticPoint& point);
bool IsLineGeometry(ByteSpan geometry,
                    std::span<const map::GeodeticPoint> points);

// The time in UTC as GeoPackage has it, cut to milliseconds:
// "2026-01-01T00:00:00.000Z".
std::string GeoPackageTime(Time time);

}  // namespace fathom::storage

#endif  // FATHOM_STORAGE_GPKG_TABLES_H_
