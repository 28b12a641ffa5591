// Where a vehicle can go: navigable water of an area on a square grid, and
// the shortest way over it.

#ifndef FATHOM_SIM_FEEDER_WATER_GRID_H_
#define FATHOM_SIM_FEEDER_WATER_GRID_H_

#include <cstddef>
#include <cstdint>
#include <vector>

#include "sim_feeder/local_terrain.h"
#include "sim_feeder/survey_area.h"
#include "sim_feeder/track_plan.h"

namespace fathom::feeder {

// Immutable after construction; thread-safe.
class WaterGrid {
 public:
  // The cells are as large as the terrain's, but at most kMaxCellsPerSide fit
  // along the longer side. A cell is open where every look at the terrain, half
  // a terrain cell apart, finds min_water_m; around a hole in the terrain the
  // neighbours are closed too.
  WaterGrid(const LocalTerrain& terrain, const SurveyArea& area,
            double min_water_m);

  static constexpr double kMaxCellsPerSide = 500.0;

  // Whether the place is in the largest connected (by four neighbours) water.
  bool IsOpen(const PlanePoint& place) const;

  // Whether the straight way lies in open water (looked at every half cell).
  bool IsClear(const PlanePoint& from, const PlanePoint& to) const;

  // The corners of a short way over open water, both ends included. REQUIRES:
  // both ends open. A* over eight neighbours, then corners that are not needed
  // are left out: O(cells log cells) at worst.
  std::vector<PlanePoint> FindWay(const PlanePoint& from,
                                  const PlanePoint& to) const;

  double cell_m() const { return cell_m_; }
  std::size_t open_cells() const { return open_cells_; }

 private:
  std::size_t IndexOf(const PlanePoint& place) const;
  PlanePoint CenterOf(std::size_t index) const;
  // Closes a cell and its eight neighbours.
  void CloseAround(std::size_t index);
  void KeepLargestWater();
  std::vector<std::size_t> SearchCells(std::size_t from, std::size_t to) const;

  double cell_m_ = 1.0;
  std::size_t rows_ = 0;     // From the south.
  std::size_t columns_ = 0;  // From the west.
  std::vector<std::uint8_t> open_;
  std::size_t open_cells_ = 0;
};

}  // namespace fathom::feeder

#endif  // FATHOM_SIM_FEEDER_WATER_GRID_H_
