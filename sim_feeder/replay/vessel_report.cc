#include "sim_feeder/replay/vessel_report.h"

#include <chrono>
#include <cmath>

#include "absl/strings/str_format.h"
#include "client/proto_time.h"
#include "sim_feeder/angles.h"

namespace fathom::feeder {
namespace {

constexpr double kMetresPerSecondPerKnot = 1852.0 / 3600.0;

}  // namespace

v1::ContactClass ClassOf(const std::optional<AisShip>& ship) {
  if (!ship.has_value()) return v1::CONTACT_CLASS_UNKNOWN;
  const bool tanker = ship->ship_type / 10 == 8;
  if (tanker || ship->draught_m.value_or(0) >= kDeepDraughtM) {
    return v1::CONTACT_CLASS_DEEP_DRAUGHT;
  }
  if (ship->length_m > 0) {
    return ship->length_m < kSmallCraftM ? v1::CONTACT_CLASS_SMALL_CRAFT
                                         : v1::CONTACT_CLASS_VESSEL;
  }
  // 36 sailing, 37 pleasure craft; 60 to 79 passenger and cargo.
  if (ship->ship_type == 36 || ship->ship_type == 37) {
    return v1::CONTACT_CLASS_SMALL_CRAFT;
  }
  const int kind = ship->ship_type / 10;
  return kind == 6 || kind == 7 ? v1::CONTACT_CLASS_VESSEL
                                : v1::CONTACT_CLASS_UNKNOWN;
}

v1::ContactReport FixOf(std::uint32_t mmsi, const AisPosition& position,
                        const std::optional<AisShip>& ship, Time time) {
  v1::ContactReport report;
  report.set_contact_id(absl::StrFormat("mmsi:%09u", mmsi));
  report.set_contact_class(ClassOf(ship));
  *report.mutable_time() = client::ToProto(time);
  v1::ContactFix& fix = *report.mutable_fix();
  fix.mutable_position()->set_latitude_deg(position.place.latitude_deg);
  fix.mutable_position()->set_longitude_deg(position.place.longitude_deg);
  constexpr double kCoarseStdM = 185.2 / 3.4641016;  // Of a uniform error.
  const double gnss_std_m = position.accurate ? 5.0 : 10.0;
  fix.set_position_std_m(position.coarse ? std::hypot(gnss_std_m, kCoarseStdM)
                                         : gnss_std_m);
  // A ship that does not move has no course to tell.
  const bool moves = position.speed_kn.value_or(0) > 0;
  const bool known = position.speed_kn.has_value() &&
                     (!moves || position.course_deg.has_value());
  if (known && moves) {
    const double speed_m_s = *position.speed_kn * kMetresPerSecondPerKnot;
    const double course_rad = *position.course_deg * kRadiansPerDegree;
    fix.set_velocity_north_m_s(speed_m_s * std::cos(course_rad));
    fix.set_velocity_east_m_s(speed_m_s * std::sin(course_rad));
  }
  fix.set_velocity_std_m_s(known ? 0.5 : 5.0);
  return report;
}

Time TimeOfFix(Time received, const std::optional<int>& utc_second) {
  if (!utc_second.has_value()) return received;
  const Time minute = std::chrono::floor<std::chrono::minutes>(received);
  Time fix = minute + std::chrono::seconds(*utc_second);
  if (fix - received > std::chrono::seconds(30)) fix -= std::chrono::minutes(1);
  if (received - fix > std::chrono::seconds(30)) fix += std::chrono::minutes(1);
  return std::chrono::abs(fix - received) <= std::chrono::seconds(10)
             ? fix
             : received;
}

}  // namespace fathom::feeder
