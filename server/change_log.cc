#include "server/change_log.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "map/contacts/contacts_view.h"
#include "map/global/global_map_view.h"
#include "map/local/local_block.h"
#include "map/local/local_map_view.h"

namespace fathom::server {
namespace {

// Owners of areas that are no activity's.
constexpr int64_t kGlobal = -1;
constexpr int64_t kEverywhere = -2;
constexpr uint64_t kWholeActivity = std::numeric_limits<uint64_t>::max();

// How far beyond a block its cells are drawn upon: smoothing's reach, the rings
// behind it that tell how rough the floor is (4), and a cell to each side.
double ReachM(const map::LocalMapOptions& options) {
  return std::ceil(options.smoothing_distance_m / options.cell_size_m) *
             options.cell_size_m +
         6 * options.cell_size_m;
}

// The rectangle of a NED frame.
GeoBox BoxIn(const map::NedFrame& frame, double south_m, double west_m,
             double north_m, double east_m) {
  return BoxAround(std::array{frame.ToGeodetic(south_m, west_m),
                              frame.ToGeodetic(north_m, west_m),
                              frame.ToGeodetic(north_m, east_m),
                              frame.ToGeodetic(south_m, east_m)},
                   /*margin_m=*/0.01);
}

GeoBox BoxOfBlock(const map::LocalMapView& local, map::BlockIndex block) {
  const double reach_m = ReachM(local.options());
  const double side_m = local.options().cell_size_m * map::kBlockSide;
  const double south_m = block.row * side_m;
  const double west_m = block.col * side_m;
  return BoxIn(local.frame(), south_m - reach_m, west_m - reach_m,
               south_m + side_m + reach_m, west_m + side_m + reach_m);
}

GeoBox BoxOfActivity(const map::LocalMapView& local) {
  const double cell_m = local.options().cell_size_m;
  return BoxIn(local.frame(), -cell_m, -cell_m,
               (local.cells_north() + 1.0) * cell_m,
               (local.cells_east() + 1.0) * cell_m);
}

}  // namespace

void ChangeLog::Restart(ViewPtr view) {
  MutexLock lock(mutex_);
  areas_.Restart(view->revision());
  RestartContacts(*view);
  view_ = std::move(view);
}

void ChangeLog::RestartContacts(const map::ObstacleMapView& view) {
  contacts_.Restart(view.revision());
  names_.clear();
  numbers_.clear();
  view.contacts().ForEach([this](const map::Contact& contact) FATHOM_REQUIRES(
                              mutex_) { NumberOf(contact.key()); });
}

uint32_t ChangeLog::NumberOf(const map::ContactKey& key) {
  const auto [held, is_new] =
      numbers_.emplace(key, static_cast<uint32_t>(names_.size()));
  if (is_new) names_.push_back(key);
  return held->second;
}

void ChangeLog::Rest() {
  ViewPtr last;
  MutexLock lock(mutex_);
  last.swap(view_);
}

ChangeLog::ViewPtr ChangeLog::view() const {
  MutexLock lock(mutex_);
  return view_;
}

GeoBox ChangeLog::BoxOf(const AreaKey& area, const map::ObstacleMapView& before,
                        const map::ObstacleMapView& now) {
  if (area.owner == kEverywhere) return {};
  if (area.owner == kGlobal) {
    return BoxAround(now.global().root().Corners(
                         map::TileKey::FromPacked(area.piece).Root()),
                     /*margin_m=*/0.01);
  }
  const auto index = static_cast<size_t>(area.owner);
  const map::ActivityView& after = *now.activities()[index];
  if (area.piece != kWholeActivity) {
    return BoxOfBlock(*after.local,
                      {.row = static_cast<uint32_t>(area.piece >> 32),
                       .col = static_cast<uint32_t>(area.piece)});
  }
  return BoxOfActivity(after.open() ? *after.local
                                    : *before.activities()[index]->local);
}

std::vector<ChangeLog::AreaKey> ChangeLog::AreasChanged(
    const map::ObstacleMapView& before, const map::ObstacleMapView& now) const {
  std::vector<AreaKey> areas;
  map::DiffTiles(before.global(), now.global(),
                 [&](const map::TileKey& key, const map::Tile*) {
                   areas.push_back({kGlobal, key.Packed()});
                 });
  for (size_t i = 0; i < now.activities().size(); ++i) {
    const auto& after = now.activities()[i];
    const auto* old =
        i < before.activities().size() ? before.activities()[i].get() : nullptr;
    if (old == after.get()) continue;
    const auto owner = static_cast<int64_t>(i);
    const bool was_open = old != nullptr && old->open();
    if (was_open != after->open()) {
      areas.push_back({owner, kWholeActivity});
    } else if (was_open) {
      map::DiffBlocks(
          *old->local, *after->local,
          [&](map::BlockIndex block, const map::LocalBlock&) {
            areas.push_back({owner, uint64_t{block.row} << 32 | block.col});
          });
    }
  }
  if (areas.size() > options_.most_areas_at_once) {
    areas.assign(1, {kEverywhere, 0});
  }
  return areas;
}

void ChangeLog::Show(ViewPtr view) {
  const ViewPtr before = this->view();
  if (view->revision() < before->revision() || view == before) return;
  if (view->revision() == before->revision()) {
    // Nothing has changed but what it keeps in memory.
    MutexLock lock(mutex_);
    view_ = std::move(view);
    return;
  }
  const std::vector<AreaKey> areas = AreasChanged(*before, *view);
  std::vector<map::ContactKey> contacts;
  map::DiffContacts(
      before->contacts(), view->contacts(),
      [&](const map::Contact& contact) { contacts.push_back(contact.key()); },
      [&](const map::ContactKey& key) { contacts.push_back(key); });
  const uint64_t revision = view->revision();
  MutexLock lock(mutex_);
  for (const AreaKey& area : areas) {
    areas_.Enter(area, revision, [&] { return BoxOf(area, *before, *view); });
  }
  for (const map::ContactKey& key : contacts) {
    contacts_.Enter(NumberOf(key), revision, [] { return Empty{}; });
  }
  // Names of contacts long gone: whoever watches is sent those there are.
  if (names_.size() > std::max(options_.most_names, view->contacts().size())) {
    RestartContacts(*view);
  }
  // `before` holds the old view until the lock is gone.
  view_ = std::move(view);
}

ChangeLog::Read ChangeLog::ReadAreas(
    ChangeNumber seen, absl::FunctionRef<void(const GeoBox&)> visit) const {
  MutexLock lock(mutex_);
  Read read = {.view = view_,
               .lost = areas_.Lost(seen),
               .seen = ChangeNumber::After(view_->revision())};
  if (read.lost) return read;
  areas_.ForEachAfter(seen,
                      [&](const AreaKey&, const GeoBox& box) { visit(box); });
  return read;
}

ChangeLog::Read ChangeLog::ReadContacts(
    ChangeNumber seen, absl::FunctionRef<void(uint32_t)> visit) const {
  MutexLock lock(mutex_);
  Read read = {.view = view_,
               .lost = contacts_.Lost(seen),
               .seen = ChangeNumber::After(view_->revision())};
  if (read.lost) return read;
  contacts_.ForEachAfter(seen,
                         [&](uint32_t number, const Empty&) { visit(number); });
  return read;
}

ChangeLog::Read ChangeLog::ReadAllContacts(
    absl::FunctionRef<void(uint32_t)> visit) const {
  MutexLock lock(mutex_);
  for (uint32_t number = 0; number < names_.size(); ++number) {
    if (view_->contacts().Find(names_[number]) != nullptr) visit(number);
  }
  return {.view = view_,
          .lost = false,
          .seen = ChangeNumber::After(view_->revision())};
}

std::optional<map::ContactKey> ChangeLog::ContactOf(uint32_t number,
                                                    ChangeNumber seen) const {
  MutexLock lock(mutex_);
  if (contacts_.Lost(seen)) return std::nullopt;
  return names_[number];
}

}  // namespace fathom::server
