// What each class of moving obstacle stands for: its size, how deep it
// reaches, how much it manoeuvres and how long it may be silent.
//
// The numbers are defaults by class, configurable per mission
// (ContactMapOptions::classes): the process noise of real traffic differs a
// hundredfold between waters (domain.md section 6: 5e-5 to 2.8e-2 m^2/s^3,
// fitted to AIS tracks). Plain values; thread-safe.

#ifndef FATHOM_MAP_CONTACTS_CONTACT_CLASS_H_
#define FATHOM_MAP_CONTACTS_CONTACT_CLASS_H_

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "absl/status/status.h"

namespace fathom::map {

// Kinds of moving obstacle. The numbers are those of fathom.v1.ContactClass
// and are stored: never reuse one.
enum class ContactClass : std::uint8_t {
  kUnknown = 1,      // Treated as a large vessel.
  kSmallCraft = 2,   // Boats, yachts, fishing craft under 25 m.
  kVessel = 3,       // Ferries, coasters, ships.
  kDeepDraught = 4,  // Tankers, carriers.
  kSubmerged = 5,    // Submarines and other vehicles below the surface.
  kDrifting = 6,     // Containers, ice, nets.
};

// One past the greatest ContactClass.
inline constexpr std::size_t kContactClassEnd = 7;

// Whether the number is one of the enumerators.
constexpr bool IsContactClass(ContactClass contact_class) {
  const auto number = static_cast<std::size_t>(contact_class);
  return number >= 1 && number < kContactClassEnd;
}

// "small_craft" and so on; "?" for a number that is none.
std::string_view ContactClassName(ContactClass contact_class);

// The parameters of one class.
struct ContactClassParameters {
  // Radius of the disc that holds the contact, metres, >= 0.
  double radius_m = 0;
  // How deep it reaches below the mission's datum, metres. A submerged
  // contact that states no depth may be anywhere down to here.
  double keel_depth_m = 0;
  // Vertical size of a contact whose own depth is known, metres, >= 0.
  double height_m = 0;
  // Density q of the continuous white acceleration per axis, m^2/s^3, >= 0:
  // after T seconds the velocity has wandered by sqrt(q T) per axis, 1 sigma.
  double process_noise_m2_s3 = 0;
  // 1 sigma per axis of the velocity of a contact that was heard once, m/s,
  // > 0. Wide: a first report says nothing of speed.
  double first_velocity_std_m_s = 0;
  // Silence after which the contact is inactive, seconds, > 0; a later report
  // starts its track anew (Nervegna 2002, section 5.5).
  double stale_after_s = 0;
};

// Indexed by ContactClass; element 0 is unused.
using ContactClassTable = std::array<ContactClassParameters, kContactClassEnd>;

// The defaults, each with its reason in contact_class.cc.
const ContactClassTable& DefaultContactClasses();

// Whether every class holds finite numbers in the ranges stated above.
// Errors: INVALID_ARGUMENT naming class, field and value.
absl::Status ValidateContactClasses(const ContactClassTable& classes);

}  // namespace fathom::map

#endif  // FATHOM_MAP_CONTACTS_CONTACT_CLASS_H_
