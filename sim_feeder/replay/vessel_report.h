// Contact reports from what AIS tells. Pure functions.

#ifndef FATHOM_SIM_FEEDER_REPLAY_VESSEL_REPORT_H_
#define FATHOM_SIM_FEEDER_REPLAY_VESSEL_REPORT_H_

#include <cstdint>
#include <optional>

#include "base/time.h"
#include "fathom/v1/ingest_service.pb.h"
#include "sim_feeder/replay/ais.h"

namespace fathom::feeder {

// How deep a draught makes a vessel CONTACT_CLASS_DEEP_DRAUGHT, metres; the
// length below which it is small craft, metres (the class's definition).
inline constexpr double kDeepDraughtM = 8.0;
inline constexpr int kSmallCraftM = 25;

// The class of a ship of which `ship` is known; UNKNOWN (taken for a large
// vessel) where nothing is.
v1::ContactClass ClassOf(const std::optional<AisShip>& ship);

// A fix with contact id "mmsi:<nine digits>". Uncertainties, 1 sigma per axis:
// 5 m where the ship says better than 10 m, else 10 m, and the rounding of a
// coarse one (0.1', 185 m: 54 m); 0.5 m/s of a velocity told, and 5 m/s
// about standstill where speed or course is not.
v1::ContactReport FixOf(std::uint32_t mmsi, const AisPosition& position,
                        const std::optional<AisShip>& ship, Time time);

// When a fix was made that was received at `received`: at the second that it
// tells, within half a minute; `received` where it tells none or one more than
// 10 s away, for then one of the two clocks is wrong.
Time TimeOfFix(Time received, const std::optional<int>& utc_second);

}  // namespace fathom::feeder

#endif  // FATHOM_SIM_FEEDER_REPLAY_VESSEL_REPORT_H_
