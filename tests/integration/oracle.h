// What a live server ought to answer, by brute force and from the domain's
// formulas alone: nothing of map/ is used, every contact and every sounding is
// gone through for every question.
//
//   cells     mean and variance after each sounding, Nervegna 2002, eqs. 4.17,
//             4.18 with 4.20 (kalman) or 4.21 (nervegna); adaptive: from all
//             soundings of a cell and of its neighbours at once, as
//             map/local/adaptive.h states the model; aged by rate x age
//   contacts  fixes, each the truth when it came: between two of them what the
//             one before foretells and the one behind tells back, together;
//             behind the last the prediction under white acceleration (eqs.
//             5.19-5.23 with Q = q [T^3/3 T^2/2; T^2/2 T]). A fix is equally
//             sure of north and east and both move by the same law: one 2 x 2
//             filter per axis is exact.
//   P         domain.md section 1; the disc by quadrature
//
// Metres are north and east of the scene's corner on a tangent plane.

#ifndef FATHOM_TESTS_INTEGRATION_ORACLE_H_
#define FATHOM_TESTS_INTEGRATION_ORACLE_H_

#include <array>
#include <optional>
#include <vector>

namespace fathom::oracle {

// N(mean, variance), and when it was last measured, seconds; absent: never.
struct Depth {
  double mean_m = 0;
  double variance_m2 = 0;
  std::optional<double> measured_s = std::nullopt;
};

enum class Rule { kKalman, kNervegna, kAdaptive };

// One sounding more; without a prior it is taken as it is. REQUIRES: not
// kAdaptive, which is no rule of one sounding.
Depth Fuse(const std::optional<Depth>& prior, double depth_m, double std_m,
           double time_s, Rule rule);

struct Sounding {
  double depth_m = 0;
  double std_m = 0;
  double time_s = 0;
};

// What is under a point.
struct Seabed {
  bool known = false;
  bool land = false;
  Depth depth;
  // From here downward something narrower than the cell was sounded.
  std::optional<double> hazard_m = std::nullopt;
};

// What the adaptive estimator says of a cell from the soundings of it and its
// eight neighbours, rows from south to north, each from west to east; index 4
// is the cell itself, which has some. Null: none.
using Around = std::array<const std::vector<Sounding>*, 9>;
Seabed ReadAdaptive(const Around& cells, const std::optional<Depth>& prior,
                    double cell_size_m);

// A fix by C4I: taken as truth.
struct Fix {
  double time_s = 0;
  double north_m = 0;
  double east_m = 0;
  double velocity_north_m_s = 0;
  double velocity_east_m_s = 0;
  double position_std_m = 0;
  double velocity_std_m_s = 0;
};

struct Track {
  // By class: GetMissionStatus publishes them.
  double radius_m = 0;
  double keel_depth_m = 0;
  double process_noise_m2_s3 = 0;
  // In order of time.
  std::vector<Fix> fixes;
};

struct Question {
  double north_m = 0;
  double east_m = 0;
  double depth_m = 0;
  double time_s = 0;
  double clearance_m = 0;
  double radius_m = 0;
};

struct Expected {
  double probability = 0;
  // The part of the contacts alone.
  double moving = 0;
  // z + h less the hazard's depth, metres; absent: no hazard.
  std::optional<double> into_hazard_m = std::nullopt;
};

// Where a contact will be or was: means, and the variance of each axis.
struct Place {
  double north_m = 0;
  double east_m = 0;
  double variance_m2 = 0;
};
// Absent before its first fix.
std::optional<Place> PlaceOf(const Track& track, double time_s);

Expected Answer(const Question& question, const Seabed& seabed,
                const std::vector<Track>& tracks, double ageing_m2_s);

}  // namespace fathom::oracle

#endif  // FATHOM_TESTS_INTEGRATION_ORACLE_H_
