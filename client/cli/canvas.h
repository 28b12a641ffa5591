// A Cairo drawing in memory, with the few strokes that the pictures need.
// Lengths are pixels, y grows downwards. Thread safety: one thread at a time.

#ifndef FATHOM_CLIENT_CLI_CANVAS_H_
#define FATHOM_CLIENT_CLI_CANVAS_H_

#include <cairo/cairo.h>

#include <cstdint>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "client/cli/colormap.h"

namespace fathom::client::cli {

// Largest side of a picture: Cairo's own limit is 32 767.
inline constexpr int kMaxPictureSide = 20'000;

struct Rectangle {
  double x = 0;
  double y = 0;
  double width = 0;
  double height = 0;
};

enum class Align { kLeft, kCenter, kRight };

struct TextStyle {
  double size = 13;
  Color color = {0.13, 0.16, 0.2};
  bool bold = false;
  Align align = Align::kLeft;
  // Width of a white outline behind the letters; 0: none.
  double halo = 0;
};

class Canvas {
 public:
  // White. REQUIRES: sides in [1, kMaxPictureSide].
  Canvas(int width, int height);

  cairo_t* cairo() const { return cairo_.get(); }

  void SetColor(const Color& color, double alpha = 1);
  void Fill(const Rectangle& r);
  void Stroke(const Rectangle& r, double line_width);
  void Line(double x0, double y0, double x1, double y1, double line_width);
  // The text's baseline begins, is centred or ends at (x, y).
  void Text(const std::string& text, double x, double y,
            const TextStyle& style);
  double TextWidth(const std::string& text, const TextStyle& style);
  // Grey diagonals: nothing is known there.
  void Hatch(const Rectangle& r);

  // Errors: INVALID_ARGUMENT (cannot write there).
  absl::Status WritePng(const std::string& path);

 private:
  struct DestroySurface {
    void operator()(cairo_surface_t* s) const { cairo_surface_destroy(s); }
  };
  struct DestroyCairo {
    void operator()(cairo_t* c) const { cairo_destroy(c); }
  };

  void SelectFont(const TextStyle& style);

  std::unique_ptr<cairo_surface_t, DestroySurface> surface_;
  std::unique_ptr<cairo_t, DestroyCairo> cairo_;
};

}  // namespace fathom::client::cli

#endif  // FATHOM_CLIENT_CLI_CANVAS_H_
