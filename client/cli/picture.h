// The map as a picture: one to four panels on one PNG, each with its scale or
// key, all with the same area: depth (relief, labelled contours, track and
// contacts), std, age, what stands behind each cell, and the difference to
// another map. Every colour scale has a lightness that tells the value, and
// the categories are Okabe and Ito's, so that colour-blind eyes and grey
// prints tell them apart.
//
// Land is tan, what nobody knows is hatched grey, so that neither is taken for
// water. The projection is equirectangular with true lengths at the area's
// middle latitude: shapes are right for areas up to some degrees, and the
// scale bar holds at the middle. Thread-safe.

#ifndef FATHOM_CLIENT_CLI_PICTURE_H_
#define FATHOM_CLIENT_CLI_PICTURE_H_

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "client/cli/cell_layers.h"
#include "client/region.h"
#include "fathom/v1/types.pb.h"

namespace fathom::client::cli {

enum class PanelKind { kDepth, kStd, kAge, kLayer, kDifference };

struct PictureInput {
  Region region;
  // Left to right, then down; 1 to 4, each at most once.
  std::vector<PanelKind> panels = {PanelKind::kDepth, PanelKind::kStd};
  // For kLayer: one per cell.
  std::vector<CellLayer> layers;
  // For kDifference: this map's depth less the other's, metres, one per cell;
  // NaN: one of them does not know it.
  std::vector<float> difference_m;
  // What the other map is called.
  std::string against;
  std::string title;
  // One line below it: mission, revision, time.
  std::string subtitle;
  // Name of the vertical datum, for the legend.
  std::string vertical_datum;
  // Where the vehicle went, in order.
  std::vector<v1::GeodeticPoint> track;
  // Drawn with 1- and 2-sigma ellipses (39 % and 86 % of the probability in
  // two dimensions) and a line of one minute's way.
  std::vector<v1::ContactEstimate> contacts;
  // Width of the picture, pixels, in [600, 8000]; the height follows.
  int width_px = 1800;
};

// Writes the picture. Errors: INVALID_ARGUMENT (width, panels without their
// values, an area too slender to
// draw, a file that cannot be written).
absl::Status DrawPicture(const PictureInput& input, const std::string& path);

}  // namespace fathom::client::cli

#endif  // FATHOM_CLIENT_CLI_PICTURE_H_
