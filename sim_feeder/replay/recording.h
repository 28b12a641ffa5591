// Recordings of real days at sea, read one event after the other: soundings,
// pings and what was known of other vessels.
//
// Three kinds of files, told apart by what is in them:
//   nmea       a log of NMEA 0183 sentences, gzip or not: own positions (RMC,
//              GGA, GLL) and depths (DBT, DPT) become soundings, AIS (VDM, VDO)
//              becomes contact fixes. Times are those of tag blocks, of RMC,
//              ZDA, GLL and GGA.
//   table      whatever GDAL reads as a table of points (CSV, GeoJSON,
//              GeoPackage, shapefile, XYZ text). With a column of ids (mmsi)
//              contact fixes, with `across` and `depth_below` the beams of
//              multibeam pings, else soundings.
//   autoferry  detections of the Autoferry dataset (JSON) beside the file of
//              ground truth of the same name, which says which boat it was
//
// Nothing is lost silently: what cannot be used is counted by reason. A
// recording is read forward once; open it again to begin again.
// Not thread-safe.

#ifndef FATHOM_SIM_FEEDER_REPLAY_RECORDING_H_
#define FATHOM_SIM_FEEDER_REPLAY_RECORDING_H_

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <variant>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "base/time.h"
#include "fathom/v1/ingest_service.pb.h"
#include "map/geodesy/points.h"

namespace fathom::feeder {

// One depth measured straight below.
struct Sounding {
  map::GeodeticPoint place = {};
  // Below the zero that the recording counts from, metres, positive down.
  double depth_m = 0;
  // 1 sigma, metres, > 0.
  double std_m = 0;
};

// A ping or a report lacks source, epoch, sequence and activity: the replay's.
struct RecordedEvent {
  Time time = {};
  std::variant<Sounding, v1::Ping, v1::ContactReport> what;
};

struct RecordingOptions {
  // Empty: told from the file; else "nmea", "table" or "autoferry".
  std::string format = {};
  // Time of the first line of a log that tells none, and the day of times of
  // day whose date it does not tell.
  std::optional<Time> start_time = {};
  // Between lines that tell no time, seconds.
  double line_interval_s = 0.1;
  // The values of a table are elevations.
  bool positive_up = false;
  // 1 sigma of depths that come without; absent: of IHO S-44 order 1b.
  std::optional<double> depth_std_m = {};
  // The table's uncertainties are those of 95 %, not of 1 sigma.
  bool uncertainty_95 = false;
  // Depth of the transducer below the surface, metres: added to depths below
  // it (DBT, DPT without offset, depth_below).
  double transducer_depth_m = 0;
};

class Recording {
 public:
  Recording() = default;
  Recording(const Recording&) = delete;
  Recording& operator=(const Recording&) = delete;
  virtual ~Recording() = default;

  // The next event; absent at the end. Errors: DATA_LOSS where the file cannot
  // be read on (named, with the line or row).
  virtual absl::StatusOr<std::optional<RecordedEvent>> Next() = 0;

  // Lines or rows that were passed over, by reason; that such lines are not
  // this reader's business ("other sentence") counts too.
  const std::map<std::string, std::uint64_t>& passed_over() const {
    return passed_over_;
  }

 protected:
  void PassOver(std::string_view reason) {
    ++passed_over_[std::string(reason)];
  }
  // For what its message says.
  void PassOver(const absl::Status& reason) {
    PassOver(std::string(reason.message()));
  }

 private:
  std::map<std::string, std::uint64_t> passed_over_ = {};
};

// Errors: NOT_FOUND (no such file), INVALID_ARGUMENT (a kind that is not known,
// a table without the columns needed, a path that GDAL cannot read).
absl::StatusOr<std::unique_ptr<Recording>> OpenRecording(
    const std::string& path, const RecordingOptions& options);

// Each kind by itself; errors as OpenRecording.
absl::StatusOr<std::unique_ptr<Recording>> OpenNmeaLog(
    const std::string& path, const RecordingOptions& options);
absl::StatusOr<std::unique_ptr<Recording>> OpenPointTable(
    const std::string& path, const RecordingOptions& options);
absl::StatusOr<std::unique_ptr<Recording>> OpenAutoferry(
    const std::string& path, const RecordingOptions& options);

// The vertical uncertainty that IHO S-44 (edition 6) allows order 1b surveys,
// sqrt(0.5^2 + (0.013 d)^2) m at 95 %, as 1 sigma.
double Order1bStdM(double depth_m);

// Whether a depth may be believed: not a logger's sentinel and inside the
// contract's range, [-100, 12000] m.
bool IsDepth(double depth_m);

}  // namespace fathom::feeder

#endif  // FATHOM_SIM_FEEDER_REPLAY_RECORDING_H_
