#include "server/watch_region.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/status_macros.h"
#include "server/limits.h"

namespace fathom::server {
namespace {

uint32_t TilesAcross(uint32_t cells) {
  return (cells + kWatchTileSide - 1) / kWatchTileSide;
}

}  // namespace

absl::StatusOr<RegionWatch> RegionWatch::Create(
    const v1::WatchRegionRequest& request, const ChangeLog& log,
    const Clock& clock) {
  const FieldPath root;
  FATHOM_ASSIGN_OR_RETURN(
      Region region,
      Region::Create(request.region(), clock.Now(), FieldPath(root, "region")));
  return RegionWatch(std::move(region), log, clock,
                     {request.from_revision(), request.run_id()});
}

RegionWatch::RegionWatch(Region region, const ChangeLog& log,
                         const Clock& clock, ResumePoint resume)
    : log_(&log),
      clock_(&clock),
      region_(std::move(region)),
      tile_rows_(TilesAcross(region_.rows())),
      tile_columns_(TilesAcross(region_.columns())),
      progress_(resume) {}

void RegionWatch::MarkAll() {
  marks_.MarkFirst(size_t{tile_rows_} * tile_columns_);
}

// Cells in columns `west` to `east`, counted from the grid's corner.
void RegionWatch::MarkColumns(uint32_t first_row, uint32_t last_row,
                              double west, double east) {
  if (east < 0 || west >= region_.columns()) return;
  const auto first = static_cast<uint32_t>(std::max(west, 0.0));
  const auto last = static_cast<uint32_t>(
      std::min(east, static_cast<double>(region_.columns() - 1)));
  for (uint32_t row = first_row / kWatchTileSide;
       row <= last_row / kWatchTileSide; ++row) {
    for (uint32_t column = first / kWatchTileSide;
         column <= last / kWatchTileSide; ++column) {
      marks_.Mark(size_t{row} * tile_columns_ + column);
    }
  }
}

void RegionWatch::Mark(const GeoBox& box) {
  if (marks_.count() == size_t{tile_rows_} * tile_columns_) return;
  // A cell's shoalest depth may be of a place one cell beyond its border, and
  // a little for the bow of its sides.
  constexpr double kRim = 2;
  const double row_deg = region_.latitude_step_deg();
  const double column_deg = region_.longitude_step_deg();
  const double north =
      (region_.north_west().latitude_deg - box.north_deg) / row_deg - kRim;
  const double south =
      (region_.north_west().latitude_deg - box.south_deg) / row_deg + kRim;
  if (south < 0 || north >= region_.rows()) return;
  const auto first_row = static_cast<uint32_t>(std::max(north, 0.0));
  const auto last_row = static_cast<uint32_t>(
      std::min(south, static_cast<double>(region_.rows() - 1)));
  const double west_deg =
      EastwardDeg(region_.north_west().longitude_deg, box.west_deg);
  const double width = box.width_deg / column_deg;
  // As it lies, and a turn further west.
  for (const double from_deg : {west_deg, west_deg - 360}) {
    const double west = from_deg / column_deg;
    MarkColumns(first_row, last_row, west - kRim, west + width + kRim);
  }
}

absl::Status RegionWatch::WriteTile(const ChangeLog::ViewPtr& view,
                                    const std::atomic<bool>& stop,
                                    Response* out) {
  const size_t tile = marks_.Take();
  const auto row = static_cast<uint32_t>(tile / tile_columns_);
  const auto column = static_cast<uint32_t>(tile % tile_columns_);
  Region::Block block = {.first_row = row * kWatchTileSide,
                         .first_column = column * kWatchTileSide};
  block.rows = std::min(kWatchTileSide, region_.rows() - block.first_row);
  block.columns =
      std::min(kWatchTileSide, region_.columns() - block.first_column);
  FATHOM_RETURN_IF_ERROR(region_.Open(view));
  region_.set_now(clock_->Now());
  // An unfinished one is not sent: who stops it has gone.
  region_.Read(block, stop, out->mutable_tile());
  region_.Close();
  WriteStamp(*view, out->mutable_stamp());
  progress_.Told();
  return absl::OkStatus();
}

absl::StatusOr<WatchStep> RegionWatch::Next(SteadyTime now,
                                            const std::atomic<bool>& stop,
                                            Response* out) {
  out->Clear();
  out->set_total_rows(region_.rows());
  out->set_total_columns(region_.columns());
  if (!progress_.begun()) {
    seen_ = progress_.Begin(*log_);
    if (progress_.from_start()) MarkAll();
  }
  const ChangeLog::Read read =
      log_->ReadAreas(seen_, [this](const GeoBox& box) { Mark(box); });
  seen_ = read.seen;
  if (read.lost) {
    MarkAll();
    progress_.SayLost(*read.view, out);
    return WatchStep::kMessage;
  }
  if (!marks_.empty()) {
    FATHOM_RETURN_IF_ERROR(WriteTile(read.view, stop, out));
    return WatchStep::kMessage;
  }
  if (!progress_.Due(*read.view, now)) return WatchStep::kIdle;
  progress_.Say(*read.view, log_->run(), now, out->mutable_progress());
  WriteStamp(*read.view, out->mutable_stamp());
  return WatchStep::kMessage;
}

}  // namespace fathom::server
