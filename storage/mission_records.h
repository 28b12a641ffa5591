// What goes into a mission file and comes out of it, as plain values.
//
// The file always equals a checkpoint of the map (tiles, local blocks,
// activities, contacts, as of one revision) and the journal of the events
// behind it, in order. Restoring the one and replaying the other gives the map
// that was acknowledged, bit for bit (restore.h does both).

#ifndef FATHOM_STORAGE_MISSION_RECORDS_H_
#define FATHOM_STORAGE_MISSION_RECORDS_H_

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "base/time.h"
#include "map/contacts/contact.h"
#include "map/contacts/contact_report.h"
#include "map/geodesy/ids.h"
#include "map/geodesy/ping.h"
#include "map/geodesy/points.h"
#include "map/global/global_map.h"
#include "map/local/local_map.h"
#include "map/obstacle_map/events.h"
#include "map/obstacle_map/obstacle_map.h"
#include "map/obstacle_map/obstacle_map_view.h"

namespace fathom::storage {

// What a mission is, fixed at its creation.
struct MissionMetadata {
  // Random, unique over all missions; 1 to 128 bytes.
  std::string mission_id;
  // For people; at most kMaxNameBytes.
  std::string name;
  // What depth 0 is: "MLLW", "MSL", ...
  std::string vertical_datum;
  Time created;
  // Western corners of the root square (Nervegna 2002, fig. 4-13).
  map::GeodeticPoint root_south_west;
  map::GeodeticPoint root_north_west;
  // Finest cell of the global map, metres, > 0.
  double min_cell_m = 0;
  // Most leaves of the global map.
  std::uint64_t max_cells = 0;
  // Of conglomeration, metres, >= 0.
  double tolerance_m = 0;
  // Variance that evidence gains per second of age, m^2/s, >= 0.
  double ageing_rate_m2_s = 0;
  std::uint32_t max_contacts = 0;
  // map::FilterName of the contacts' filter.
  std::string contact_filter;

  friend bool operator==(const MissionMetadata&,
                         const MissionMetadata&) = default;
};

// Bytes of the texts in MissionMetadata, at most.
inline constexpr std::size_t kMaxNameBytes = 1024;

// The kinds of numbered messages; each source counts them apart. In kImports
// the source is an import's id, the epoch 1, the sequence the number of its
// last tile in the map. Stored: never reuse a number.
enum class StreamKind : std::uint8_t {
  kPings = 1,
  kContacts = 2,
  kImports = 3
};

// The last message of a source that is in the file (applied or refused for
// good): everything up to it in its epoch is a resend. That of an import is
// committed with the checkpoint that holds its tiles, never before.
struct SourcePosition {
  StreamKind stream = StreamKind::kPings;
  map::SourceId source;
  std::uint64_t epoch = 0;
  std::uint64_t sequence = 0;

  friend bool operator==(const SourcePosition&,
                         const SourcePosition&) = default;
};

// A ping that was applied.
struct PingRecord {
  map::SourceId source;
  std::uint64_t epoch = 0;
  std::uint64_t sequence = 0;
  map::Ping ping;

  friend bool operator==(const PingRecord&, const PingRecord&) = default;
};

// A contact report that was applied; its source is report.key.source.
struct ContactRecord {
  std::uint64_t epoch = 0;
  std::uint64_t sequence = 0;
  map::ContactReport report;

  friend bool operator==(const ContactRecord&, const ContactRecord&) = default;
};

// One applied event. Only events that can be replayed without the outside are
// journalled; transfers, completions and imports write a checkpoint instead.
struct JournalRecord {
  // Revision of the map after the event; never falls from one to the next.
  std::uint64_t revision = 0;
  std::variant<PingRecord, ContactRecord, map::StartActivity, map::DropContact>
      event;
};

// What was believed of a contact after one of its reports or its drop.
struct ContactHistoryRow {
  // Revision of the map after it.
  std::uint64_t revision = 0;
  map::ContactEstimate estimate;
  // Takes the place of this contact's rows of earlier revisions at its time
  // and later: a late report changed what is believed from there on.
  bool revises = false;
};

// A part of the Earth between two parallels and two meridians, degrees, borders
// included; west of `west_deg` > `east_deg` across the antimeridian.
// Longitudes in [-180, 180].
struct HistoryArea {
  double south_deg = -90;
  double north_deg = 90;
  double west_deg = -180;
  double east_deg = 180;

  bool Holds(const map::GeodeticPoint& point) const;
};

// How much of the contact history is kept; what is older goes first. Judged at
// each checkpoint, so that what a journal could make again is never in doubt.
struct HistoryLimits {
  // Beside the newest estimate in blocks.
  std::optional<Duration> max_age;
  // Of what is kept in blocks and shown to GDAL (HistoryTotal::bytes): about
  // 120 bytes an estimate.
  std::optional<std::uint64_t> max_bytes;
};

// A state of the map to be written whole.
struct Checkpoint {
  // The map as of now->revision(): journal records up to it are then covered.
  std::shared_ptr<const map::ObstacleMapView> now;
  // The map as of the file's last checkpoint: only what differs is written.
  // It must be descended from the same ObstacleMap. nullptr: everything is
  // written anew.
  std::shared_ptr<const map::ObstacleMapView> previous;
};

// What is committed in one transaction.
struct Batch {
  // In the order of application.
  std::vector<JournalRecord> journal;
  std::vector<ContactHistoryRow> contact_history;
  // Positions that the journal records do not show: of refused messages. The
  // records' own are taken from them; these are applied after.
  std::vector<SourcePosition> source_positions;
  std::optional<Checkpoint> checkpoint;

  bool empty() const {
    return journal.empty() && contact_history.empty() &&
           source_positions.empty() && !checkpoint.has_value();
  }
};

// An activity with its local map's blocks; none if it has ended.
struct LoadedActivity {
  map::StoredActivity activity;
  std::vector<std::pair<map::BlockIndex, map::LocalBlock>> blocks;
};

// A mission as read back. Order: activities by their start, tiles coarse
// before fine, contacts by key, blocks by index.
struct Loaded {
  MissionMetadata metadata;
  std::vector<map::RestoredTile> tiles;
  std::vector<LoadedActivity> activities;
  std::vector<map::StoredContact> contacts;
  std::vector<SourcePosition> source_positions;
  // Revision and time of the newest evidence of the checkpoint.
  std::uint64_t checkpoint_revision = 0;
  Time checkpoint_as_of{};
  // As of the checkpoint.
  map::MissionCounters counters;
  // Events behind the checkpoint, to be replayed in this order.
  std::vector<JournalRecord> journal;
  // Revision of the last record, or of the checkpoint: where the map will be.
  std::uint64_t revision = 0;
  // What could not be read and was left out, for people: tiles in quarantine
  // (quarantine.h). Empty: everything is sound.
  std::vector<std::string> damage;
};

}  // namespace fathom::storage

#endif  // FATHOM_STORAGE_MISSION_RECORDS_H_
