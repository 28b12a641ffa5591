// A small chart of lines and points over time, as PNG.

#ifndef FATHOM_TESTS_ACCURACY_LINE_CHART_H_
#define FATHOM_TESTS_ACCURACY_LINE_CHART_H_

#include <string>
#include <vector>

namespace fathom::accuracy {

struct ChartSeries {
  std::string name;
  std::vector<double> values = {};  // As many as the chart's x.
  bool points = false;              // Dots instead of a line.
  double red = 0;
  double green = 0;
  double blue = 0;
};

struct LineChart {
  std::string title;
  std::string x_label;
  std::string y_label;
  std::vector<double> x = {};
  std::vector<ChartSeries> series = {};
};

// 560 x 340 pixels. False if it cannot be written.
bool DrawChart(const LineChart& chart, const std::string& path);

}  // namespace fathom::accuracy

#endif  // FATHOM_TESTS_ACCURACY_LINE_CHART_H_
