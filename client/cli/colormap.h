// Colours whose lightness tells the value: each map's lightness (OKLab L, B.
// Ottosson, "A perceptual color space for image processing", 2020) runs evenly
// from one end to the other, so equal steps of the value look equally large,
// also in grey and to colour-blind eyes. Thread-safe.

#ifndef FATHOM_CLIENT_CLI_COLORMAP_H_
#define FATHOM_CLIENT_CLI_COLORMAP_H_

#include <vector>

namespace fathom::client::cli {

// sRGB, each in [0, 1].
struct Color {
  double red = 0;
  double green = 0;
  double blue = 0;
};

// OKLab: lightness in [0, 1] and two opponent axes.
struct OkLab {
  double lightness = 0;
  double a = 0;
  double b = 0;
};
OkLab ToOkLab(const Color& color);
// Clamped to the sRGB gamut.
Color FromOkLab(const OkLab& lab);

class Colormap {
 public:
  // Shallow water pale, deep water dark blue.
  static Colormap Depth();
  // Certain pale, uncertain dark violet.
  static Colormap Std();
  // New pale, old dark green.
  static Colormap Age();
  // Shoaler orange, equal nearly white, deeper blue: both ends equally dark,
  // apart for every kind of colour blindness.
  static Colormap Difference();

  // The colour at `t`, clamped to [0, 1]; `shade` multiplies the lightness.
  Color At(double t, double shade = 1) const;

 private:
  // Hue and chroma come from the stops, lightness runs evenly between the
  // first and the last.
  explicit Colormap(const std::vector<Color>& stops);
  Colormap() = default;

  std::vector<OkLab> table_;
};

}  // namespace fathom::client::cli

#endif  // FATHOM_CLIENT_CLI_COLORMAP_H_
