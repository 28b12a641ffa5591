#include "client/cli/watch_picture.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "absl/strings/str_format.h"
#include "client/cli/contact_text.h"
#include "client/cli/text.h"

namespace fathom::client::cli {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
// From the deepest to the shoalest.
constexpr char kShades[] = ".:-=+*%@#";
constexpr int kDeepestToShoalest = 8;

std::string ProgressText(std::uint64_t revision) {
  return absl::StrFormat("map revision %d: all told\n", revision);
}

std::string ResyncText(std::uint64_t lost) {
  return absl::StrFormat(
      "resynchronised: %d revisions went by; the state comes anew\n", lost);
}

}  // namespace

void RegionPicture::Resize(std::uint32_t rows, std::uint32_t columns) {
  if (rows == rows_ && columns == columns_) return;
  rows_ = rows;
  columns_ = columns;
  shoalest_m_.assign(std::size_t{rows} * columns, kNaN);
}

void RegionPicture::Take(const v1::WatchRegionResponse& event) {
  Resize(event.total_rows(), event.total_columns());
  if (event.has_resync()) {
    std::fill(shoalest_m_.begin(), shoalest_m_.end(), kNaN);
  }
  const v1::RegionTile& tile = event.tile();
  const std::uint64_t cells = std::uint64_t{tile.rows()} * tile.columns();
  if (tile.first_row() + tile.rows() > rows_ ||
      tile.first_column() + tile.columns() > columns_ ||
      static_cast<std::uint64_t>(tile.shoalest_m_size()) != cells) {
    return;  // Not a tile of this grid.
  }
  for (std::uint32_t row = 0; row < tile.rows(); ++row) {
    for (std::uint32_t column = 0; column < tile.columns(); ++column) {
      shoalest_m_[std::size_t{tile.first_row() + row} * columns_ +
                  tile.first_column() + column] =
          tile.shoalest_m(static_cast<int>(row * tile.columns() + column));
    }
  }
}

std::string RegionPicture::Text() const {
  const std::uint32_t high = std::min(rows_, kPictureRows);
  const std::uint32_t wide = std::min(columns_, kPictureColumns);
  std::vector<float> picture(std::size_t{high} * wide, kNaN);
  float shoalest_m = kNaN;
  float deepest_m = kNaN;
  for (std::uint32_t row = 0; row < rows_; ++row) {
    for (std::uint32_t column = 0; column < columns_; ++column) {
      const float cell_m = shoalest_m_[std::size_t{row} * columns_ + column];
      const std::uint64_t y = std::uint64_t{row} * high / rows_;
      const std::uint64_t x = std::uint64_t{column} * wide / columns_;
      float& shown_m = picture[y * wide + x];
      // fmin and fmax pass over a NaN.
      shown_m = std::fmin(shown_m, cell_m);
      shoalest_m = std::fmin(shoalest_m, cell_m);
      deepest_m = std::fmax(deepest_m, cell_m);
    }
  }
  std::string text;
  for (std::uint32_t y = 0; y < high; ++y) {
    for (std::uint32_t x = 0; x < wide; ++x) {
      const float depth_m = picture[std::size_t{y} * wide + x];
      if (std::isnan(depth_m)) {
        text += ' ';
        continue;
      }
      const float span_m = std::max(deepest_m - shoalest_m, 1e-3F);
      const float share = (deepest_m - depth_m) / span_m;
      text += kShades[std::lround(share * kDeepestToShoalest)];
    }
    text += '\n';
  }
  if (std::isnan(shoalest_m)) return text + "nothing known\n";
  return text + absl::StrFormat("# %.1f m (shoalest)   . %.1f m\n", shoalest_m,
                                deepest_m);
}

void ContactsPicture::Take(const v1::WatchContactsResponse& event) {
  if (event.has_resync()) contacts_.clear();
  if (!event.has_estimate()) return;
  const v1::ContactEstimate& estimate = event.estimate();
  contacts_[{estimate.source_id(), estimate.contact_id()}] = estimate;
}

std::string ContactsPicture::Text() const {
  std::string text = kContactColumns;
  for (const auto& [key, contact] : contacts_) {
    if (contact.status() == v1::CONTACT_STATUS_DROPPED) continue;
    text += ContactRow(contact);
  }
  return text;
}

std::string EventText(const v1::WatchRegionResponse& event) {
  if (event.has_progress()) return ProgressText(event.stamp().map_revision());
  if (event.has_resync()) return ResyncText(event.resync().updates_lost());
  const v1::RegionTile& tile = event.tile();
  float shoalest_m = kNaN;
  int known = 0;
  for (int k = 0; k < tile.shoalest_m_size(); ++k) {
    shoalest_m = std::fmin(shoalest_m, tile.shoalest_m(k));
    known += std::isnan(tile.shoalest_m(k)) ? 0 : 1;
  }
  return absl::StrFormat(
      "map revision %d: rows %d-%d, columns %d-%d: %d cells known%s\n",
      event.stamp().map_revision(), tile.first_row(),
      tile.first_row() + tile.rows() - 1, tile.first_column(),
      tile.first_column() + tile.columns() - 1, known,
      known > 0 ? absl::StrFormat(", shoalest %.2f m", shoalest_m) : "");
}

std::string EventText(const v1::WatchContactsResponse& event) {
  if (event.has_progress()) return ProgressText(event.stamp().map_revision());
  if (event.has_resync()) return ResyncText(event.resync().updates_lost());
  return ContactRow(event.estimate());
}

std::string EventText(const v1::WatchTrajectoryResponse& event) {
  std::string text =
      absl::StrFormat("map revision %d: %s", event.stamp().map_revision(),
                      event.alert() ? "ALERT" : "clear");
  if (!event.has_verdict()) return text + ", unchanged\n";
  absl::StrAppendFormat(&text, ", %s", StateText(event.verdict().state()));
  if (event.verdict().has_first_conflict()) {
    const v1::Conflict& conflict = event.verdict().first_conflict();
    absl::StrAppendFormat(&text, "; conflict on leg %d, %s, at %s",
                          conflict.leg_index(), TimeText(conflict.time()),
                          PlaceText(conflict.position()));
  }
  return text + "\n";
}

}  // namespace fathom::client::cli
