// A mission's contact history as a GeoPackage (OGC 12-128r18): what GDAL and
// QGIS open without a converter. Layers:
//   contact_points  a point for each estimate, with time, class, velocity
//   contact_tracks  a line through each contact's estimates, in their order
// Positions are WGS 84 longitude and latitude, degrees (EPSG:4326).

#ifndef FATHOM_STORAGE_GEOPACKAGE_H_
#define FATHOM_STORAGE_GEOPACKAGE_H_

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "storage/mission_records.h"
#include "storage/sqlite.h"

namespace fathom::storage {

struct ExportedContacts {
  std::uint64_t points = 0;
  // Contacts with at least two estimates.
  std::uint64_t tracks = 0;
};

// Writes the history that `mission` holds, as of one moment, to a new file at
// `path`, which appears complete or not at all. Memory: one contact's
// positions. Errors: ALREADY_EXISTS; those of sqlite.h.
// `replayed`: what its journal adds (history_replay.h).
absl::StatusOr<ExportedContacts> ExportContacts(
    Connection& mission, const std::vector<ContactHistoryRow>& replayed,
    const std::string& path);

}  // namespace fathom::storage

#endif  // FATHOM_STORAGE_GEOPACKAGE_H_
