// Map matching: where is the vehicle really? A fresh survey, made with a
// position that has drifted, is moved over the stored map until the sea floors
// agree.
//
//   map_matching 127.0.0.1:7430 ACTIVITY [SEARCH_M]
//   matched 2500 cells: add 24.2 m north and -31.9 m east to the position
//
// 1. GetRegion with activity_id reads the fresh local map alone, GetRegion with
//    layer GLOBAL the stored map around it. They must not be asked jointly:
//    the joined map would show the fresh cells in both.
// 2. For each shift the spread of the depth differences is taken. A wrong tide
//    moves all differences alike and does not matter.
// 3. The least spread wins; a parabola through its neighbours refines it.
//
// The stored map is also the prior of the fresh one, which draws the match
// towards no shift; fresh soundings outweigh it (std below the stored one's).
// Exit code: 0 matched, 3 the floor is too flat or too little overlaps, 1
// anything else.

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include "base/status_macros.h"
#include "client/client.h"

namespace v1 = fathom::v1;
using fathom::client::Client;
using fathom::client::Region;

namespace {

// Metres of a degree (WGS 84; Snyder 1987, eqs. 4-18 and 4-20).
struct MetresPerDegree {
  explicit MetresPerDegree(double latitude_deg) {
    const double sine = std::sin(latitude_deg * M_PI / 180);
    const double w = 1 - 0.00669438 * sine * sine;
    north = M_PI / 180 * 6'378'137.0 * (1 - 0.00669438) / std::pow(w, 1.5);
    east = M_PI / 180 * 6'378'137.0 / std::sqrt(w) *
           std::cos(latitude_deg * M_PI / 180);
  }
  double north;
  double east;
};

// One measured cell of the fresh map.
struct Sounding {
  double latitude_deg;
  double longitude_deg;
  double depth_m;
};

std::vector<Sounding> Measured(const Region& fresh) {
  std::vector<Sounding> soundings;
  for (std::uint32_t row = 0; row < fresh.rows; ++row) {
    for (std::uint32_t column = 0; column < fresh.columns; ++column) {
      const std::size_t i = fresh.Index(row, column);
      if (fresh.kind[i] != v1::EVIDENCE_KIND_MEASURED) continue;
      soundings.push_back({fresh.north_west.latitude_deg() -
                               (row + 0.5) * fresh.latitude_step_deg,
                           fresh.north_west.longitude_deg() +
                               (column + 0.5) * fresh.longitude_step_deg,
                           fresh.depth_m[i]});
    }
  }
  return soundings;
}

// Depth of the stored map between its cells' centres; NaN where one of the
// four around was never measured.
double DepthAt(const Region& stored, double latitude_deg,
               double longitude_deg) {
  const double row = (stored.north_west.latitude_deg() - latitude_deg) /
                         stored.latitude_step_deg -
                     0.5;
  const double column = (longitude_deg - stored.north_west.longitude_deg()) /
                            stored.longitude_step_deg -
                        0.5;
  if (row < 0 || column < 0 || row >= stored.rows - 1 ||
      column >= stored.columns - 1) {
    return NAN;
  }
  const auto i = static_cast<std::uint32_t>(row);
  const auto j = static_cast<std::uint32_t>(column);
  const double down = row - i;
  const double right = column - j;
  const auto depth_m = [&](std::uint32_t r, std::uint32_t c) -> double {
    const std::size_t index = stored.Index(r, c);
    return stored.kind[index] == v1::EVIDENCE_KIND_MEASURED
               ? stored.depth_m[index]
               : NAN;
  };
  return (1 - down) *
             ((1 - right) * depth_m(i, j) + right * depth_m(i, j + 1)) +
         down *
             ((1 - right) * depth_m(i + 1, j) + right * depth_m(i + 1, j + 1));
}

// Variance of stored minus fresh depth with the fresh map moved by
// (north, east), m^2; NaN if less than half of it overlaps.
double Spread(const std::vector<Sounding>& fresh, const Region& stored,
              double north_deg, double east_deg) {
  double sum = 0;
  double sum_of_squares = 0;
  std::size_t count = 0;
  for (const Sounding& sounding : fresh) {
    const double difference = DepthAt(stored, sounding.latitude_deg + north_deg,
                                      sounding.longitude_deg + east_deg) -
                              sounding.depth_m;
    if (std::isnan(difference)) continue;
    sum += difference;
    sum_of_squares += difference * difference;
    ++count;
  }
  if (count == 0 || 2 * count < fresh.size()) return NAN;
  const double mean = sum / static_cast<double>(count);
  return sum_of_squares / static_cast<double>(count) - mean * mean;
}

// Where the parabola through (-1, before), (0, least), (1, after) is least.
double Vertex(double before, double least, double after) {
  const double bend = before - 2 * least + after;
  return bend > 0 ? (before - after) / (2 * bend) : 0;
}

absl::StatusOr<int> Run(const char* server, const char* activity,
                        double search_m) {
  FATHOM_ASSIGN_OR_RETURN(const auto client, Client::Connect(server, {}));
  FATHOM_ASSIGN_OR_RETURN(const auto status, client->GetMissionStatus());
  v1::ActivityParameters area;
  for (const v1::ActivityStatus& known : status.activities()) {
    if (known.activity_id() == activity) area = known.parameters();
  }
  const double cell_m = area.cell_size_m();
  if (cell_m <= 0) {
    return absl::NotFoundError("the mission has no such activity");
  }

  // The fresh map, and the stored one as far around it as we search.
  const v1::GeodeticPoint& corner = area.south_west();
  const MetresPerDegree metres(corner.latitude_deg());
  const auto fetch = [&](double margin_m, v1::MapLayer layer) {
    v1::GetRegionRequest request;
    v1::GeodeticPoint* south_west = request.mutable_south_west();
    v1::GeodeticPoint* north_east = request.mutable_north_east();
    south_west->set_latitude_deg(corner.latitude_deg() -
                                 margin_m / metres.north);
    south_west->set_longitude_deg(corner.longitude_deg() -
                                  margin_m / metres.east);
    north_east->set_latitude_deg(corner.latitude_deg() +
                                 (area.north_extent_m() + margin_m) /
                                     metres.north);
    north_east->set_longitude_deg(corner.longitude_deg() +
                                  (area.east_extent_m() + margin_m) /
                                      metres.east);
    request.set_resolution_m(cell_m);
    request.set_layer(layer);
    if (layer == v1::MAP_LAYER_LOCAL) request.set_activity_id(activity);
    return client->GetRegion(request);
  };
  FATHOM_ASSIGN_OR_RETURN(const Region local, fetch(0, v1::MAP_LAYER_LOCAL));
  FATHOM_ASSIGN_OR_RETURN(const Region stored,
                          fetch(search_m + 2 * cell_m, v1::MAP_LAYER_GLOBAL));
  const std::vector<Sounding> fresh = Measured(local);

  // Every shift of half a cell.
  const double step_m = cell_m / 2;
  const int reach = static_cast<int>(std::floor(search_m / step_m));
  const auto spread = [&](int i, int j) {
    return Spread(fresh, stored, i * step_m / metres.north,
                  j * step_m / metres.east);
  };
  double least = INFINITY;
  double most = 0;
  int north = 0;
  int east = 0;
  for (int i = -reach; i <= reach; ++i) {
    for (int j = -reach; j <= reach; ++j) {
      const double here = spread(i, j);
      if (std::isnan(here)) continue;
      most = std::fmax(most, here);
      if (here < least) {
        least = here;
        north = i;
        east = j;
      }
    }
  }
  std::printf("spread of the differences: %.3f m at best, %.3f m at worst\n",
              std::sqrt(least), std::sqrt(most));
  // A floor without features looks alike everywhere.
  if (!(most > 4 * least)) {
    std::printf("no match: too flat, or too little of it overlaps\n");
    return 3;
  }
  const double north_m =
      step_m *
      (north + Vertex(spread(north - 1, east), least, spread(north + 1, east)));
  const double east_m = step_m * (east + Vertex(spread(north, east - 1), least,
                                                spread(north, east + 1)));
  std::printf(
      "matched %zu cells: add %.1f m north and %.1f m east to the "
      "position\n",
      fresh.size(), north_m, east_m);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3 || argc > 4) {
    std::fprintf(stderr, "usage: map_matching SERVER ACTIVITY [SEARCH_M]\n");
    return 1;
  }
  const absl::StatusOr<int> code =
      Run(argv[1], argv[2], argc == 4 ? std::atof(argv[3]) : 60);
  if (!code.ok()) {
    std::fprintf(stderr, "%s\n", code.status().ToString().c_str());
    return 1;
  }
  return *code;
}
