// One map on a canvas: a frame that knows where each place lies, and what is
// drawn in it. Thread safety: as its canvas.

#ifndef FATHOM_CLIENT_CLI_MAP_PANEL_H_
#define FATHOM_CLIENT_CLI_MAP_PANEL_H_

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "client/cli/canvas.h"
#include "client/cli/value_scale.h"
#include "client/region.h"
#include "fathom/v1/types.pb.h"

namespace fathom::client::cli {

// The colours that mean something, for maps and their keys.
inline constexpr Color kLandColor = {0.898, 0.839, 0.714};
inline constexpr Color kShoreColor = {0.47, 0.39, 0.25};
inline constexpr Color kFrameColor = {0.13, 0.16, 0.2};
inline constexpr Color kTrackColor = {0.93, 0.36, 0.13};
inline constexpr Color kContactColor = {0.72, 0.07, 0.38};
inline constexpr Color kWhiteColor = {1, 1, 1};

// Shores and contours are drawn for grids up to this size; above it a cell is
// far below a pixel.
inline constexpr std::size_t kMaxOutlinedCells = 4'000'000;

class MapPanel {
 public:
  // Draws `region` into `frame` of `canvas`; both must outlive this. The
  // frame must have the region's shape (HeightPerWidth).
  MapPanel(Canvas& canvas, const Region& region, const Rectangle& frame);

  // Height of a frame that shows the region's true shape, per its width.
  static double HeightPerWidth(const Region& region);

  // Colour of a cell that is neither land nor unknown, by index; false: treat
  // it as unknown.
  using CellColor = std::function<bool(std::size_t index, Color* color)>;

  // Hatching, then all known cells, then land and its shore.
  void DrawCells(const CellColor& color_of);
  // Contours at these levels; their labels are chosen here and written by
  // DrawContourLabels, above what is drawn between.
  void DrawContours(const std::vector<float>& values,
                    const std::vector<double>& levels);
  void DrawContourLabels();
  // The frame with marks of latitude and longitude.
  void DrawGraticule();
  void DrawTrack(const std::vector<v1::GeodeticPoint>& track);
  void DrawContacts(const std::vector<v1::ContactEstimate>& contacts);
  void DrawScaleBar();
  void DrawNorthArrow();

  double meters_per_pixel() const { return meters_per_pixel_; }

 private:
  struct Point {
    double x = 0;
    double y = 0;
  };
  struct ContourLabel {
    std::string text;
    Point at;          // Middle.
    double angle = 0;  // Of the line, radians.
    double half_width = 0;
  };
  // Chooses places along one line; `along` are the lengths up to each point.
  void AddContourLabels(const std::string& text,
                        const std::vector<Point>& points,
                        const std::vector<double>& along);
  // Whether a label about `middle` lies inside, clear of all else.
  bool IsFree(const Point& middle, double width) const;

  Point ToPixel(const v1::GeodeticPoint& place) const;
  void ClipToFrame();
  void DrawShore();
  // At the frame, an arrow to a contact that lies outside at `p`.
  void DrawContactOutside(const v1::ContactEstimate& contact, const Point& p);

  // Writes a contact's name from `at`, or up to it with `ends_at`; inside the
  // frame and on no other name.
  void PlaceLabel(const std::string& text, Point at, bool ends_at, double size);

  Canvas& canvas_;
  const Region& region_;
  const Rectangle frame_;
  double meters_per_pixel_ = 0;
  // Where names stand, by their baselines.
  std::vector<Rectangle> labels_;
  std::vector<ContourLabel> contour_labels_;
};

}  // namespace fathom::client::cli

#endif  // FATHOM_CLIENT_CLI_MAP_PANEL_H_
