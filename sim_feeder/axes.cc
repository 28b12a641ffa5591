#include "sim_feeder/axes.h"

namespace fathom::feeder {

using client::cli::Align;
using client::cli::Canvas;
using client::cli::Rectangle;
using client::cli::ValueScale;

void DrawAxes(Canvas& canvas, const Rectangle& frame, const AxisWords& words,
              const ValueScale& x, const ValueScale& y) {
  canvas.Text(words.title, frame.x, frame.y - 14, {.size = 15, .bold = true});
  for (const double tick : x.Ticks(6)) {
    const double at = frame.x + x.Place(tick) * frame.width;
    canvas.SetColor(kGrid);
    canvas.Line(at, frame.y, at, frame.y + frame.height, 1);
    canvas.Text(ValueScale::TickText(tick), at, frame.y + frame.height + 18,
                {.size = 12, .align = Align::kCenter});
  }
  for (const double tick : y.Ticks(6)) {
    const double at = frame.y + (1 - y.Place(tick)) * frame.height;
    canvas.SetColor(kGrid);
    canvas.Line(frame.x, at, frame.x + frame.width, at, 1);
    canvas.Text(ValueScale::TickText(tick), frame.x - 8, at + 4,
                {.size = 12, .align = Align::kRight});
  }
  canvas.Text(words.across, frame.x + frame.width / 2,
              frame.y + frame.height + 40,
              {.size = 12, .align = Align::kCenter});
  canvas.Text(words.up, frame.x, frame.y + frame.height + 58, {.size = 12});
  canvas.SetColor(kInk);
  canvas.Stroke(frame, 1);
}

}  // namespace fathom::feeder
