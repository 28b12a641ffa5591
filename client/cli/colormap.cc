#include "client/cli/colormap.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace fathom::client::cli {
namespace {

constexpr int kTableSize = 256;

Color Hex(unsigned rgb) {
  return {static_cast<double>(rgb >> 16 & 0xff) / 255,
          static_cast<double>(rgb >> 8 & 0xff) / 255,
          static_cast<double>(rgb & 0xff) / 255};
}

double Linear(double s) {
  return s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4);
}

double Encoded(double l) {
  l = std::clamp(l, 0.0, 1.0);
  return l <= 0.0031308 ? 12.92 * l : 1.055 * std::pow(l, 1 / 2.4) - 0.055;
}

}  // namespace

OkLab ToOkLab(const Color& color) {
  const double r = Linear(color.red);
  const double g = Linear(color.green);
  const double b = Linear(color.blue);
  const double l =
      std::cbrt(0.4122214708 * r + 0.5363325363 * g + 0.0514459929 * b);
  const double m =
      std::cbrt(0.2119034982 * r + 0.6806995451 * g + 0.1073969566 * b);
  const double s =
      std::cbrt(0.0883024619 * r + 0.2817188376 * g + 0.6299787005 * b);
  return {0.2104542553 * l + 0.7936177850 * m - 0.0040720468 * s,
          1.9779984951 * l - 2.4285922050 * m + 0.4505937099 * s,
          0.0259040371 * l + 0.7827717662 * m - 0.8086757660 * s};
}

Color FromOkLab(const OkLab& lab) {
  const double l_ = lab.lightness + 0.3963377774 * lab.a + 0.2158037573 * lab.b;
  const double m_ = lab.lightness - 0.1055613458 * lab.a - 0.0638541728 * lab.b;
  const double s_ = lab.lightness - 0.0894841775 * lab.a - 1.2914855480 * lab.b;
  const double l = l_ * l_ * l_;
  const double m = m_ * m_ * m_;
  const double s = s_ * s_ * s_;
  return {Encoded(4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s),
          Encoded(-1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s),
          Encoded(-0.0041960863 * l - 0.7034186147 * m + 1.7076147010 * s)};
}

Colormap::Colormap(const std::vector<Color>& stops) {
  std::vector<OkLab> labs;
  for (const Color& stop : stops) labs.push_back(ToOkLab(stop));
  const double first = labs.front().lightness;
  const double last = labs.back().lightness;
  for (int i = 0; i < kTableSize; ++i) {
    const double lightness =
        first + (last - first) * i / static_cast<double>(kTableSize - 1);
    // The pair of stops around this lightness.
    std::size_t k = 0;
    while (k + 2 < labs.size() &&
           (labs[k + 1].lightness - lightness) * (last - first) < 0) {
      ++k;
    }
    const double span = labs[k + 1].lightness - labs[k].lightness;
    const double t = std::clamp((lightness - labs[k].lightness) / span, 0., 1.);
    table_.push_back({lightness, labs[k].a + t * (labs[k + 1].a - labs[k].a),
                      labs[k].b + t * (labs[k + 1].b - labs[k].b)});
  }
}

Colormap Colormap::Depth() {
  return Colormap({Hex(0xeaf6ef), Hex(0xbfe3dd), Hex(0x8ccbd6), Hex(0x58abcf),
                   Hex(0x3585bd), Hex(0x2a5f9e), Hex(0x213b78), Hex(0x141c44)});
}

Colormap Colormap::Std() {
  return Colormap({Hex(0xfdf6e3), Hex(0xfbdcae), Hex(0xf5b37d), Hex(0xe6825f),
                   Hex(0xc7556a), Hex(0x923c73), Hex(0x5a2b66), Hex(0x2a1a40)});
}

Colormap Colormap::Age() {
  return Colormap({Hex(0xfbfbe0), Hex(0xdcefbc), Hex(0xa6d8a6), Hex(0x6bbb9b),
                   Hex(0x3b9890), Hex(0x26707c), Hex(0x1d475f), Hex(0x14213d)});
}

Colormap Colormap::Difference() {
  // Two maps that meet in the middle.
  const Colormap down({Hex(0xf6f6f4), Hex(0xf9d9b0), Hex(0xf0a95f),
                       Hex(0xd67a27), Hex(0xa5520f), Hex(0x6e3207)});
  const Colormap up({Hex(0xf6f6f4), Hex(0xc9dff0), Hex(0x8fbfe0), Hex(0x4f97c9),
                     Hex(0x256da6), Hex(0x12406f)});
  Colormap both;
  for (int i = 0; i < kTableSize; ++i) {
    const int from_middle = 2 * i - (kTableSize - 1);
    const auto at = static_cast<std::size_t>(std::abs(from_middle));
    both.table_.push_back(from_middle < 0 ? down.table_[at] : up.table_[at]);
  }
  return both;
}

Color Colormap::At(double t, double shade) const {
  const double place = std::clamp(t, 0.0, 1.0) * (kTableSize - 1);
  OkLab lab = table_[static_cast<std::size_t>(std::lround(place))];
  lab.lightness = std::clamp(lab.lightness * shade, 0.0, 1.0);
  return FromOkLab(lab);
}

}  // namespace fathom::client::cli
