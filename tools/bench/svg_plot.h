#pragma once

#include <string>
#include <utility>
#include <vector>

namespace sinew {

struct PlotLine {
  std::string name;
  std::vector<std::pair<double, double>> points;  ///< x and y, both positive; others are left out
};

/// One set of axes.
struct Plot {
  std::string title;
  std::string x_axis, y_axis;
  std::vector<PlotLine> lines;
};

/// The plots side by side as an SVG image, with one legend: logarithmic axes with a grid line at every power
/// of ten, a line's colour the same in every plot it is in.
std::string svg_of(const std::vector<Plot>& plots);

}  // namespace sinew
