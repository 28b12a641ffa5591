#include "storage/geopackage.h"

#include <string>

#include "base/status_macros.h"
#include "storage/bytes.h"
#include "storage/draft_file.h"
#include "storage/gpkg_tables.h"
#include "storage/history_reader.h"

namespace fathom::storage {
namespace {

// OGC 12-128r18: application_id "GPKG", version 1.3.
constexpr char kHeader[] =
    "PRAGMA application_id = 1196444487; PRAGMA user_version = 10300";

constexpr char kTables[] = R"sql(
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

class Exporter {
 public:
  explicit Exporter(Connection& out) : out_(out) {}

  absl::StatusOr<ExportedContacts> Run(
      Connection& mission, const std::vector<ContactHistoryRow>& replayed) {
    FATHOM_RETURN_IF_ERROR(out_.Execute(kHeader));
    FATHOM_RETURN_IF_ERROR(out_.Execute(kGeoPackageTables));
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
    end_ = estimate.time;
    if (points_.empty()) start_ = end_;
    const map::GeodeticPoint point = estimate.Position();
    const Bytes geometry = PointGeometry(point);
    const std::string time = GeoPackageTime(end_);
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
    const Bytes geometry = LineGeometry(points_);
    const std::string start = GeoPackageTime(start_);
    const std::string end = GeoPackageTime(end_);
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
  Time start_;
  Time end_;
  std::vector<map::GeodeticPoint> points_;
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
