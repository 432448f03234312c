// SPDX-License-Identifier: MIT
// A figure for the report's page: axes with units, points and lines, and what diverged, as SVG text.
// Colours are classes, which the page gives for light and dark.
#pragma once

#include <string>
#include <vector>

namespace rikiseki::lab {

struct PlotPoint {
  double x = 0;
  double y = 0;  // not finite: diverged, drawn as a cross on the upper edge
};

enum class Mark {
  kDots,
  kLine,    // through the points in their order
  kDotted,  // a line that is no measurement: theory
  kBars,    // from each point to `tops` above it
};

struct Series {
  std::string label = {};  // empty: not in the legend
  int colour = 0;          // 0 .. 5
  Mark mark = Mark::kDots;
  std::vector<PlotPoint> points = {};
  std::vector<double> tops = {};  // of kBars
};

struct Axis {
  std::string label;  // with the unit
  bool logarithmic = false;
  // Where both are equal, the range of the points; what is outside is drawn on the edge.
  double low = 0;
  double high = 0;
};

struct Plot {
  std::string title;
  Axis x;
  Axis y;
  std::vector<Series> series = {};
};

std::string Svg(const Plot& plot);

/// Three significant digits: 0.00123, 12.3, 12300, 1.23e-05.
std::string Short(double value);

}  // namespace rikiseki::lab
