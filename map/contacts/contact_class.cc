#include "map/contacts/contact_class.h"

#include <cmath>

#include "absl/strings/str_format.h"

namespace fathom::map {

std::string_view ContactClassName(ContactClass contact_class) {
  switch (contact_class) {
    case ContactClass::kUnknown:
      return "unknown";
    case ContactClass::kSmallCraft:
      return "small_craft";
    case ContactClass::kVessel:
      return "vessel";
    case ContactClass::kDeepDraught:
      return "deep_draught";
    case ContactClass::kSubmerged:
      return "submerged";
    case ContactClass::kDrifting:
      return "drifting";
  }
  return "?";
}

const ContactClassTable& DefaultContactClasses() {
  // Radius: half the length of the class's long ones, since the reported
  // point may be an antenna anywhere on board. Keel: their greatest draught.
  // Process noise: inside the range fitted to AIS (5e-5 to 2.8e-2 m^2/s^3),
  // the smaller the ship the livelier. First velocity: half the speed of a
  // fast one, so that two sigma hold it. Stale: when sqrt(q T^3 / 3), the
  // wander of the position, has passed some 400 m.
  static const ContactClassTable table = {{
      {},  // Unused: 0 is no class.
      // As the larger of vessel and deep draught, as lively as small craft.
      {.radius_m = 200,
       .keel_depth_m = 25,
       .height_m = 25,
       .process_noise_m2_s3 = 1e-2,
       .first_velocity_std_m_s = 10,
       .stale_after_s = 600},
      {.radius_m = 12,
       .keel_depth_m = 4,
       .height_m = 4,
       .process_noise_m2_s3 = 2e-2,
       .first_velocity_std_m_s = 10,
       .stale_after_s = 300},
      {.radius_m = 100,
       .keel_depth_m = 10,
       .height_m = 10,
       .process_noise_m2_s3 = 2e-3,
       .first_velocity_std_m_s = 8,
       .stale_after_s = 600},
      {.radius_m = 200,
       .keel_depth_m = 25,
       .height_m = 25,
       .process_noise_m2_s3 = 5e-4,
       .first_velocity_std_m_s = 8,
       .stale_after_s = 900},
      // 500 m: below it only research vehicles go.
      {.radius_m = 60,
       .keel_depth_m = 500,
       .height_m = 15,
       .process_noise_m2_s3 = 5e-3,
       .first_velocity_std_m_s = 8,
       .stale_after_s = 600},
      {.radius_m = 20,
       .keel_depth_m = 5,
       .height_m = 5,
       .process_noise_m2_s3 = 5e-5,
       .first_velocity_std_m_s = 1,
       .stale_after_s = 3600},
  }};
  return table;
}

absl::Status ValidateContactClasses(const ContactClassTable& classes) {
  for (std::size_t i = 1; i < kContactClassEnd; ++i) {
    const std::string_view name =
        ContactClassName(static_cast<ContactClass>(i));
    const ContactClassParameters& parameters = classes[i];
    const struct {
      const char* field;
      double value;
      bool zero_allowed;
    } checks[] = {
        {"radius_m", parameters.radius_m, true},
        {"keel_depth_m", parameters.keel_depth_m, true},
        {"height_m", parameters.height_m, true},
        {"process_noise_m2_s3", parameters.process_noise_m2_s3, true},
        {"first_velocity_std_m_s", parameters.first_velocity_std_m_s, false},
        {"stale_after_s", parameters.stale_after_s, false},
    };
    for (const auto& check : checks) {
      if (!std::isfinite(check.value) || check.value < 0.0 ||
          (check.value == 0.0 && !check.zero_allowed)) {
        return absl::InvalidArgumentError(absl::StrFormat(
            "class %s: %s=%g must be finite and %s 0", std::string(name),
            check.field, check.value, check.zero_allowed ? ">=" : ">"));
      }
    }
  }
  return absl::OkStatus();
}

}  // namespace fathom::map
