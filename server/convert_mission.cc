#include "server/convert_mission.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <string>
#include <utility>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "server/convert_common.h"
#include "server/errors.h"
#include "server/field_checks.h"
#include "server/limits.h"
#include "server/source_ledger.h"

namespace fathom::server {
namespace {

absl::StatusOr<map::EstimatorKind> ConvertEstimator(v1::Estimator estimator,
                                                    const FieldPath& path) {
  switch (estimator) {
    case v1::ESTIMATOR_UNSPECIFIED:
    case v1::ESTIMATOR_ADAPTIVE:
      return map::EstimatorKind::kAdaptive;
    case v1::ESTIMATOR_NERVEGNA:
      return map::EstimatorKind::kNervegna;
    case v1::ESTIMATOR_KALMAN:
      return map::EstimatorKind::kKalman;
    default:
      return InvalidField(
          path.ToString(),
          absl::StrFormat("%d is not a known Estimator", estimator));
  }
}

// Number of cells along a side, checked against the map's own bound so that
// the error names the field.
absl::Status CheckCells(double extent_m, double cell_size_m,
                        const FieldPath& path) {
  const double cells = std::ceil(extent_m / cell_size_m);
  if (cells <= map::kMaxLocalSideCells) return absl::OkStatus();
  return InvalidField(
      path.ToString(),
      absl::StrFormat("%g m are %.0f cells of %g m, at most %d are allowed",
                      extent_m, cells, cell_size_m, map::kMaxLocalSideCells));
}

absl::StatusOr<map::LocalMapOptions> ConvertParameters(
    const v1::ActivityParameters& parameters, const FieldPath& path) {
  map::LocalMapOptions options;
  if (!parameters.has_south_west()) {
    return Missing(FieldPath(path, "south_west"),
                   "the south-west corner of the area");
  }
  FATHOM_ASSIGN_OR_RETURN(
      options.south_west,
      CheckPoint(parameters.south_west(), FieldPath(path, "south_west")));
  constexpr NumberRange kExtent = {
      .min = 0, .max = kMaxAreaExtentM, .unit = "m", .lower = Bound::kOpen};
  const FieldPath north(path, "north_extent_m");
  const FieldPath east(path, "east_extent_m");
  const FieldPath cell(path, "cell_size_m");
  FATHOM_RETURN_IF_ERROR(
      CheckNumber(parameters.north_extent_m(), kExtent, north));
  FATHOM_RETURN_IF_ERROR(
      CheckNumber(parameters.east_extent_m(), kExtent, east));
  FATHOM_RETURN_IF_ERROR(CheckNumber(
      parameters.cell_size_m(),
      {.min = kMinCellSizeM, .max = kMaxCellSizeM, .unit = "m"}, cell));
  FATHOM_RETURN_IF_ERROR(
      CheckCells(parameters.north_extent_m(), parameters.cell_size_m(), north));
  FATHOM_RETURN_IF_ERROR(
      CheckCells(parameters.east_extent_m(), parameters.cell_size_m(), east));
  const double cells =
      std::ceil(parameters.north_extent_m() / parameters.cell_size_m()) *
      std::ceil(parameters.east_extent_m() / parameters.cell_size_m());
  if (cells > static_cast<double>(map::kMaxLocalCells)) {
    return LimitExceeded(path.ToString() + " cells",
                         static_cast<uint64_t>(cells), map::kMaxLocalCells);
  }
  options.north_extent_m = parameters.north_extent_m();
  options.east_extent_m = parameters.east_extent_m();
  options.cell_size_m = parameters.cell_size_m();
  FATHOM_ASSIGN_OR_RETURN(
      options.estimator,
      ConvertEstimator(parameters.estimator(), FieldPath(path, "estimator")));

  FATHOM_RETURN_IF_ERROR(CheckNumber(
      parameters.min_range_m(), {.min = 0, .max = kMaxSonarRangeM, .unit = "m"},
      FieldPath(path, "min_range_m")));
  const FieldPath max_range(path, "max_range_m");
  FATHOM_RETURN_IF_ERROR(
      CheckNumber(parameters.max_range_m(),
                  {.min = 0, .max = kMaxSonarRangeM, .unit = "m"}, max_range));
  options.min_range_m = parameters.min_range_m();
  options.max_range_m = parameters.max_range_m() == 0
                            ? kDefaultMaxRangeM
                            : parameters.max_range_m();
  if (options.max_range_m <= options.min_range_m) {
    return InvalidField(
        max_range.ToString(),
        absl::StrFormat("%g m must be greater than min_range_m=%g m",
                        options.max_range_m, options.min_range_m));
  }
  const FieldPath distance(path, "smoothing_distance_m");
  FATHOM_RETURN_IF_ERROR(CheckNumber(
      parameters.smoothing_distance_m(),
      {.min = 0, .max = kMaxSmoothingDistanceM, .unit = "m"}, distance));
  if (parameters.smoothing_distance_m() >
      map::kMaxSmoothReach * parameters.cell_size_m()) {
    return InvalidField(
        distance.ToString(),
        absl::StrFormat("%g m are more than %d cells of %g m",
                        parameters.smoothing_distance_m(), map::kMaxSmoothReach,
                        parameters.cell_size_m()));
  }
  FATHOM_RETURN_IF_ERROR(
      CheckNumber(parameters.smoothing_scale(),
                  {.min = 0, .max = 1, .unit = "", .upper = Bound::kOpen},
                  FieldPath(path, "smoothing_scale")));
  options.smoothing_distance_m = parameters.smoothing_distance_m();
  options.smoothing_scale = parameters.smoothing_scale();

  if (parameters.has_default_prior()) {
    const FieldPath prior(path, "default_prior");
    FATHOM_RETURN_IF_ERROR(CheckDepth(parameters.default_prior().depth_m(),
                                      FieldPath(prior, "depth_m")));
    FATHOM_RETURN_IF_ERROR(CheckNumber(parameters.default_prior().std_m(),
                                       {.min = 0,
                                        .max = kMaxDepthStdM,
                                        .unit = "m",
                                        .lower = Bound::kOpen,
                                        .reason = v1::REJECT_REASON_BAD_STD},
                                       FieldPath(prior, "std_m")));
    options.default_depth_m =
        static_cast<float>(parameters.default_prior().depth_m());
    options.default_std_m =
        static_cast<float>(parameters.default_prior().std_m());
  }
  return options;
}

v1::Estimator WireEstimator(map::EstimatorKind estimator) {
  switch (estimator) {
    case map::EstimatorKind::kNervegna:
      return v1::ESTIMATOR_NERVEGNA;
    case map::EstimatorKind::kKalman:
      return v1::ESTIMATOR_KALMAN;
    case map::EstimatorKind::kAdaptive:
      return v1::ESTIMATOR_ADAPTIVE;
  }
  return v1::ESTIMATOR_UNSPECIFIED;
}

absl::Status CheckTileNumbers(const v1::DepthTile& tile,
                              const FieldPath& path) {
  for (int i = 0; i < tile.depth_m_size(); ++i) {
    const float depth_m = tile.depth_m(i);
    const bool is_land =
        !tile.land().empty() && tile.land()[static_cast<size_t>(i)] != 0;
    if (std::isnan(depth_m) || is_land) continue;
    FATHOM_RETURN_IF_ERROR(CheckDepth(
        depth_m, FieldPath(path, "depth_m", static_cast<size_t>(i))));
  }
  for (int i = 0; i < tile.std_m_size(); ++i) {
    const float std_m = tile.std_m(i);
    // A std of NaN leaves its cell unknown, but not as the one for all.
    if (tile.std_m_size() > 1 && std::isnan(std_m)) continue;
    FATHOM_RETURN_IF_ERROR(
        CheckNumber(std_m,
                    {.min = 0,
                     .max = kMaxDepthStdM,
                     .unit = "m",
                     .lower = Bound::kOpen,
                     .reason = v1::REJECT_REASON_BAD_STD},
                    FieldPath(path, "std_m", static_cast<size_t>(i))));
  }
  for (size_t i = 0; i < tile.land().size(); ++i) {
    if (static_cast<unsigned char>(tile.land()[i]) > 1) {
      return InvalidField(
          FieldPath(path, "land", i).ToString(),
          absl::StrFormat("%d is neither 0 (water) nor 1 "
                          "(land)",
                          static_cast<unsigned char>(tile.land()[i])));
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<map::StartActivity> ConvertStart(
    const v1::StartActivityRequest& request, Time now) {
  const FieldPath root;
  map::StartActivity event;
  FATHOM_RETURN_IF_ERROR(
      CheckId(request.activity_id(), FieldPath(root, "activity_id")));
  event.id.value = request.activity_id();
  if (!request.vehicle_id().empty()) {
    FATHOM_RETURN_IF_ERROR(
        CheckId(request.vehicle_id(), FieldPath(root, "vehicle_id")));
    event.vehicle_id = request.vehicle_id();
  }
  event.start = now;
  if (request.has_time()) {
    FATHOM_ASSIGN_OR_RETURN(event.start,
                            CheckTime(request.time(), FieldPath(root, "time")));
  }
  if (!request.has_parameters()) {
    return Missing(FieldPath(root, "parameters"), "the area and its cells");
  }
  FATHOM_ASSIGN_OR_RETURN(
      event.options,
      ConvertParameters(request.parameters(), FieldPath(root, "parameters")));
  return event;
}

absl::StatusOr<map::DropContact> ConvertDrop(
    const v1::DropContactRequest& request, Time now) {
  const FieldPath root;
  map::DropContact event;
  FATHOM_RETURN_IF_ERROR(
      CheckId(request.source_id(), FieldPath(root, "source_id")));
  FATHOM_RETURN_IF_ERROR(CheckId(request.contact_id(),
                                 FieldPath(root, "contact_id"),
                                 /*allow_colon=*/true));
  event.key = {.source = {request.source_id()},
               .contact = {request.contact_id()}};
  event.time = now;
  if (request.has_time()) {
    FATHOM_ASSIGN_OR_RETURN(event.time,
                            CheckTime(request.time(), FieldPath(root, "time")));
    if (event.time - now > kMostAhead) {
      return InvalidField(
          "time", absl::StrFormat("is over %d h ahead of the server's clock",
                                  kMostAhead.count()));
    }
  }
  return event;
}

absl::StatusOr<ChartHeader> ConvertHeader(const v1::PriorHeader& header,
                                          const FieldPath& path) {
  ChartHeader result;
  FATHOM_RETURN_IF_ERROR(CheckName(header.name(), FieldPath(path, "name")));
  result.name = header.name();
  if (header.expected_cells() > kMaxImportCells) {
    return LimitExceeded(FieldPath(path, "expected_cells").ToString(),
                         header.expected_cells(), kMaxImportCells);
  }
  if (header.vertical_reference().reference() ==
      v1::DEPTH_REFERENCE_WATER_SURFACE) {
    return InvalidField(
        FieldPath(path, "vertical_reference").ToString() + ".reference",
        "charts are taken with depths below the mission's datum only");
  }
  if (header.has_survey_time()) {
    FATHOM_ASSIGN_OR_RETURN(
        const Time time,
        CheckTime(header.survey_time(), FieldPath(path, "survey_time")));
    result.time_s =
        static_cast<uint32_t>(std::chrono::floor<std::chrono::seconds>(time)
                                  .time_since_epoch()
                                  .count());
  }
  result.replace = header.replace();
  if (!header.import_id().empty()) {
    FATHOM_RETURN_IF_ERROR(
        CheckId(header.import_id(), FieldPath(path, "import_id")));
    result.import_id = header.import_id();
  } else if (header.first_tile() > 1) {
    return InvalidField(FieldPath(path, "first_tile").ToString(),
                        "an import without import_id starts with tile 1");
  }
  result.first_tile = std::max<uint64_t>(header.first_tile(), 1);
  return result;
}

absl::StatusOr<map::RasterBlock> ConvertTile(const v1::DepthTile& tile,
                                             const ChartHeader& header,
                                             const FieldPath& path) {
  map::RasterBlock block;
  if (!tile.has_north_west()) {
    return Missing(FieldPath(path, "north_west"), "the tile's corner");
  }
  FATHOM_ASSIGN_OR_RETURN(
      block.north_west,
      CheckPoint(tile.north_west(), FieldPath(path, "north_west")));
  constexpr NumberRange kStep = {
      .min = 0, .max = kMaxStepDeg, .unit = "deg", .lower = Bound::kOpen};
  FATHOM_RETURN_IF_ERROR(CheckNumber(tile.latitude_step_deg(), kStep,
                                     FieldPath(path, "latitude_step_deg")));
  FATHOM_RETURN_IF_ERROR(CheckNumber(tile.longitude_step_deg(), kStep,
                                     FieldPath(path, "longitude_step_deg")));
  const FieldPath rows(path, "rows");
  FATHOM_RETURN_IF_ERROR(CheckPositive(tile.rows(), rows));
  FATHOM_RETURN_IF_ERROR(
      CheckPositive(tile.columns(), FieldPath(path, "columns")));
  const uint64_t cells = uint64_t{tile.rows()} * tile.columns();
  if (cells > kMaxTileCells) {
    return LimitExceeded(path.ToString() + ".rows x columns", cells,
                         kMaxTileCells);
  }
  const double south_deg =
      tile.north_west().latitude_deg() - tile.rows() * tile.latitude_step_deg();
  if (south_deg < -90 - 1e-9) {
    return InvalidField(rows.ToString(),
                        absl::StrFormat("the tile reaches to latitude %g deg, "
                                        "over the pole",
                                        south_deg));
  }
  const double width_deg = tile.columns() * tile.longitude_step_deg();
  if (width_deg > 360 + 1e-9) {
    return InvalidField(
        FieldPath(path, "columns").ToString(),
        absl::StrFormat("the tile is %g deg wide, more than 360", width_deg));
  }
  if (static_cast<uint64_t>(tile.depth_m_size()) != cells) {
    return InvalidField(FieldPath(path, "depth_m").ToString(),
                        absl::StrFormat("has %d values, rows x columns is %d",
                                        tile.depth_m_size(), cells));
  }
  if (tile.std_m_size() != 1 &&
      static_cast<uint64_t>(tile.std_m_size()) != cells) {
    return InvalidField(
        FieldPath(path, "std_m").ToString(),
        absl::StrFormat("has %d values, give one for all or rows x columns=%d",
                        tile.std_m_size(), cells));
  }
  if (!tile.land().empty() && tile.land().size() != cells) {
    return InvalidField(FieldPath(path, "land").ToString(),
                        absl::StrFormat("has %d bytes, rows x columns is %d",
                                        tile.land().size(), cells));
  }
  FATHOM_RETURN_IF_ERROR(CheckTileNumbers(tile, path));
  block.latitude_step_deg = tile.latitude_step_deg();
  block.longitude_step_deg = tile.longitude_step_deg();
  block.rows = tile.rows();
  block.columns = tile.columns();
  block.depth_m.assign(tile.depth_m().begin(), tile.depth_m().end());
  block.std_m.assign(tile.std_m().begin(), tile.std_m().end());
  block.land.assign(tile.land().begin(), tile.land().end());
  block.time_s = header.time_s;
  block.replace = header.replace;
  return block;
}

void WriteTransfer(const map::TransferResult& result, double duration_s,
                   v1::TransferSummary* out) {
  out->set_local_cells(result.local_cells);
  out->set_leaves_written(result.leaves_written);
  out->set_leaves_before(result.leaves_before);
  out->set_leaves_after_write(result.leaves_after_write);
  out->set_leaves_after(result.leaves_after);
  out->set_degraded(result.degraded);
  out->set_duration_s(duration_s);
}

void WriteActivity(const map::ActivityView& activity, v1::ActivityStatus* out) {
  out->set_activity_id(activity.id.value);
  out->set_vehicle_id(activity.vehicle_id);
  const map::LocalMapOptions& options = activity.options;
  v1::ActivityParameters* parameters = out->mutable_parameters();
  WritePoint(options.south_west, parameters->mutable_south_west());
  parameters->set_north_extent_m(options.north_extent_m);
  parameters->set_east_extent_m(options.east_extent_m);
  parameters->set_cell_size_m(options.cell_size_m);
  parameters->set_estimator(WireEstimator(options.estimator));
  parameters->set_min_range_m(options.min_range_m);
  parameters->set_max_range_m(options.max_range_m);
  parameters->set_smoothing_distance_m(options.smoothing_distance_m);
  parameters->set_smoothing_scale(options.smoothing_scale);
  if (options.default_depth_m.has_value()) {
    parameters->mutable_default_prior()->set_depth_m(*options.default_depth_m);
    parameters->mutable_default_prior()->set_std_m(
        options.default_std_m.value_or(0));
  }
  WriteTime(activity.start, out->mutable_start_time());
  out->set_open(activity.open());
  out->set_cells_north(activity.cells_north);
  out->set_cells_east(activity.cells_east);
  out->set_cells_measured(activity.cells_measured);
  out->set_measurements_accepted(activity.measurements_accepted);
  WriteRejects(activity.rejects, out->mutable_rejects());
  if (activity.local.has_value()) {
    out->set_memory_bytes(activity.local->memory_bytes());
  }
}

void WriteActivities(
    const map::ObstacleMapView& view,
    google::protobuf::RepeatedPtrField<v1::ActivityStatus>* out) {
  const auto& activities = view.activities();
  for (const bool open : {true, false}) {
    for (auto it = activities.rbegin(); it != activities.rend(); ++it) {
      if (static_cast<size_t>(out->size()) >= kMaxActivitiesListed) return;
      if ((*it)->open() == open) WriteActivity(**it, out->Add());
    }
  }
}

void WriteContactClasses(const map::ContactClassTable& classes,
                         v1::ContactListStatus* out) {
  for (size_t i = 1; i < classes.size(); ++i) {
    v1::ContactClassParameters* parameters = out->add_classes();
    parameters->set_contact_class(static_cast<v1::ContactClass>(i));
    parameters->set_radius_m(classes[i].radius_m);
    parameters->set_keel_depth_m(classes[i].keel_depth_m);
    parameters->set_process_noise_m2_s3(classes[i].process_noise_m2_s3);
    parameters->set_stale_after_s(classes[i].stale_after_s);
  }
}

void WriteLimits(v1::Limits* out) {
  out->set_max_message_bytes(kMaxMessageBytes);
  out->set_max_beams_per_ping(kMaxBeamsPerPing);
  out->set_max_points_per_query(kMaxPointsPerQuery);
  out->set_max_waypoints(kMaxWaypoints);
  out->set_max_reports_per_request(kMaxReportsPerRequest);
  out->set_max_tile_cells(kMaxTileCells);
  out->set_max_region_cells(kMaxRegionCells);
  out->set_max_open_activities(map::MissionOptions{}.max_open_activities);
  out->set_max_local_cells(map::kMaxLocalCells);
  out->set_max_ingest_streams(kMaxIngestStreams);
  out->set_max_watchers(kMaxWatchers);
  out->set_max_pending_ingest(kMaxPendingIngest);
  out->set_max_local_side_cells(map::kMaxLocalSideCells);
  out->set_max_smoothing_cells(map::kMaxSmoothReach);
  out->set_max_activities(map::MissionOptions{}.max_activities);
  out->set_max_import_cells(kMaxImportCells);
  out->set_max_imports(kMaxImports);
  out->set_max_history_estimates(kMaxHistoryEstimates);
  out->set_max_bulk_streams(kMaxBulkStreams);
  out->set_max_revision_waiters(kMaxRevisionWaiters);
  out->set_max_pending_commands(kMaxPendingCommands);
  out->set_max_sources(SourceLedger::kMaxSources);
  out->set_max_searches(kMaxSearches);
  out->set_max_search_cells(kMaxSearchCells);
  out->set_max_trajectory_watchers(kMaxTrajectoryWatchers);
  out->set_max_watch_cells(kMaxWatchCells);
  out->set_max_kept_changes(kMaxKeptChanges);
}

}  // namespace fathom::server
