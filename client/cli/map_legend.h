// Scales and keys beside the maps of a picture. Thread safety: as the canvas.

#ifndef FATHOM_CLIENT_CLI_MAP_LEGEND_H_
#define FATHOM_CLIENT_CLI_MAP_LEGEND_H_

#include <array>
#include <optional>
#include <string>

#include "client/cli/canvas.h"
#include "client/cli/cell_layers.h"
#include "client/cli/colormap.h"
#include "client/cli/picture.h"
#include "client/cli/value_scale.h"

namespace fathom::client::cli {

inline constexpr Color kGrey = {0.38, 0.41, 0.45};

// The layers of the sea floor, in the order of their key.
inline constexpr std::array kKeyLayers = {CellLayer::kLocal, CellLayer::kGlobal,
                                          CellLayer::kSmoothed,
                                          CellLayer::kPrior};
// Of Okabe and Ito's palette (2008), which every kind of colour blindness
// tells apart; none for land and unknown.
std::optional<Color> LayerColor(CellLayer layer);
// "measured, local map".
const char* LayerName(CellLayer layer);

// The scale with its ticks below `bar` and the caption above it.
void DrawColorBar(Canvas& canvas, const Rectangle& bar, const Colormap& colors,
                  const ValueScale& scale, const std::string& caption);

// A box of `color` about (x, y) and its meaning; returns where the next may
// begin. KeyBoxWidth: how far away that is.
double DrawKeyBox(Canvas& canvas, double x, double y, const Color& color,
                  const std::string& text);
double KeyBoxWidth(Canvas& canvas, const std::string& text);

// The key of symbols, in one line from `x`.
void DrawKey(Canvas& canvas, double x, double y, const PictureInput& input);

}  // namespace fathom::client::cli

#endif  // FATHOM_CLIENT_CLI_MAP_LEGEND_H_
