#include "map/obstacle_map/leg_contacts.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "map/geodesy/ned_frame.h"

namespace fathom::map {
namespace {

// Parts that a leg is cut into for one contact.
constexpr int kMostParts = 64;
constexpr int kGoldenSteps = 24;

}  // namespace

LegContacts::LegContacts(const ContactsView& contacts, const TimedLeg& leg,
                         const ObstacleQuery& query, double position_std_m,
                         double reach_m)
    : contacts_(contacts),
      leg_(leg),
      query_(query),
      position_variance_m2_(position_std_m * position_std_m),
      reach_m_(reach_m) {
  if (contacts.size() == 0) return;
  for (const double share : {0.0, 0.5, 1.0}) {
    // To the farther end of the leg.
    const double farther = std::max(share, 1.0 - share);
    const double within_m =
        reach_m + kNearSigmas * position_std_m +
        farther * (leg.length_m() + kQuickestContactMS * leg.duration_s());
    contacts.ForEachNear(
        leg.PlaceAt(share), within_m, leg.TimeAt(share),
        [this](const NearContact& near) { near_.push_back(near.contact); });
  }
  std::sort(near_.begin(), near_.end());
  near_.erase(std::unique(near_.begin(), near_.end()), near_.end());
}

LegContacts::Look LegContacts::LookAt(const Contact& contact,
                                      double share) const {
  Look look;
  look.share = share;
  const auto predicted = contact.At(leg_.TimeAt(share), contacts_.classes());
  if (!predicted.has_value()) return look;
  const NedPoint vehicle =
      NedFrame(predicted->frame_origin).ToNed(leg_.PlaceAt(share));
  look.present = true;
  look.offset_m = {predicted->x(0) - vehicle.north_m,
                   predicted->x(1) - vehicle.east_m};
  look.distance_m = look.offset_m.norm();
  look.std_m = std::sqrt(predicted->P(0, 0) + predicted->P(1, 1) +
                         position_variance_m2_);
  look.reach_m = predicted->radius_m + query_.radius_m + look.std_m;
  look.contact_place = predicted->Position();
  ObstacleQuery query = query_;
  query.depth_m = leg_.DepthAt(share);
  look.probability = ContactProbability(*predicted, look.offset_m, query,
                                        position_variance_m2_);
  return look;
}

std::vector<LegContacts::Look> LegContacts::LooksAt(
    const Contact& contact) const {
  const Look first = LookAt(contact, 0);
  const Look last = LookAt(contact, 1);
  const double moved_m = (last.offset_m - first.offset_m).norm();
  const double reach_m = std::max({1.0, std::min(first.reach_m, last.reach_m)});
  const int parts =
      first.present && last.present
          ? std::clamp(static_cast<int>(moved_m / reach_m) + 1, 1, kMostParts)
          : kMostParts;
  std::vector<Look> looks = {first};
  for (int part = 1; part <= parts; ++part) {
    const Look end =
        part == parts ? last : LookAt(contact, double(part) / parts);
    const Look begin = looks.back();
    if (begin.present && end.present) {
      const Eigen::Vector2d way = end.offset_m - begin.offset_m;
      const double way2 = way.squaredNorm();
      const double closest = way2 > 0 ? -begin.offset_m.dot(way) / way2 : 0;
      if (closest > 0 && closest < 1) {
        looks.push_back(
            LookAt(contact, begin.share + closest * (end.share - begin.share)));
      }
    }
    looks.push_back(end);
  }
  // Between the neighbours of the most probable one.
  const auto most = std::max_element(looks.begin(), looks.end(),
                                     [](const Look& a, const Look& b) {
                                       return a.probability < b.probability;
                                     });
  if (most->probability < kLeastToldProbability) return looks;
  double low = most == looks.begin() ? most->share : std::prev(most)->share;
  double high =
      std::next(most) == looks.end() ? most->share : std::next(most)->share;
  constexpr double kGolden = 1 / std::numbers::phi;
  Look a = LookAt(contact, high - kGolden * (high - low));
  Look b = LookAt(contact, low + kGolden * (high - low));
  for (int step = 0; step < kGoldenSteps; ++step) {
    if (a.probability > b.probability) {
      high = b.share;
      b = a;
      a = LookAt(contact, high - kGolden * (high - low));
    } else {
      low = a.share;
      a = b;
      b = LookAt(contact, low + kGolden * (high - low));
    }
  }
  const Look& best = a.probability > b.probability ? a : b;
  if (best.probability > most->probability) {
    looks.insert(std::upper_bound(looks.begin(), looks.end(), best,
                                  [](const Look& x, const Look& y) {
                                    return x.share < y.share;
                                  }),
                 best);
  }
  return looks;
}

void LegContacts::ForEachMeeting(
    std::set<const Contact*>& near,
    absl::FunctionRef<void(const Meeting&)> visit) const {
  for (const Contact* contact : near_) {
    for (const Look& look : LooksAt(*contact)) {
      if (!look.present) continue;
      if (look.distance_m <=
          reach_m_ + look.reach_m + kNearSigmas * look.std_m) {
        near.insert(contact);
      }
      if (look.probability < kLeastToldProbability) continue;
      visit({.time = leg_.TimeAt(look.share),
             .vehicle = leg_.PlaceAt(look.share),
             .depth_m = leg_.DepthAt(look.share),
             .contact_place = look.contact_place});
    }
  }
}

void LegContacts::AddTo(const ObstacleQuery& query,
                        ObstacleAnswer& answer) const {
  ObstacleQuery at = query;
  at.position = leg_.PlaceAt(leg_.ShareAt(query.time));
  for (const Contact* contact : near_) {
    const auto predicted = contact->At(query.time, contacts_.classes());
    if (!predicted.has_value()) continue;
    const NedPoint vehicle =
        NedFrame(predicted->frame_origin).ToNed(at.position);
    const Eigen::Vector2d offset_m = {predicted->x(0) - vehicle.north_m,
                                      predicted->x(1) - vehicle.east_m};
    AddContact(at, *contact, *predicted, offset_m, position_variance_m2_,
               answer);
  }
  Conclude(at, answer);
}

}  // namespace fathom::map
