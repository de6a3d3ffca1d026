#include "tools/bench/svg_plot.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace sinew {
namespace {

// Pixels.
constexpr double kWidth = 380, kHeight = 300;                       // of the axes' box
constexpr double kLeft = 70, kTop = 40, kRight = 20, kBottom = 60;  // round it
constexpr double kLegendRow = 18;

constexpr const char* kColours[] = {"#d62728", "#ff9896", "#1f77b4", "#2ca02c",
                                    "#9467bd", "#8c564b", "#7f7f7f", "#bcbd22"};

/// Powers of ten that a range of values spans.
struct Decades {
  int low = 0, high = 1;

  double place(double value) const { return (std::log10(value) - low) / (high - low); }
};

bool drawable(const std::pair<double, double>& point) {
  return std::isfinite(point.first) && std::isfinite(point.second) && point.first > 0 && point.second > 0;
}

Decades decades_of(const std::vector<double>& values) {
  if (values.empty()) return {};
  const auto [least, most] = std::minmax_element(values.begin(), values.end());
  Decades decades{static_cast<int>(std::floor(std::log10(*least))),
                  static_cast<int>(std::ceil(std::log10(*most)))};
  decades.high = std::max(decades.high, decades.low + 1);
  return decades;
}

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1f", value);
  return text;
}

/// "0.01", "1", "10K", "1M".
std::string power_of_ten(int exponent) {
  if (exponent >= 6) return "1" + std::string(static_cast<std::size_t>(exponent - 6), '0') + "M";
  if (exponent >= 3) return "1" + std::string(static_cast<std::size_t>(exponent - 3), '0') + "K";
  if (exponent >= 0) return "1" + std::string(static_cast<std::size_t>(exponent), '0');
  return "0." + std::string(static_cast<std::size_t>(-exponent - 1), '0') + "1";
}

std::string escaped(const std::string& text) {
  std::string result;
  for (const char c : text) result += c == '<' ? "&lt;" : c == '&' ? "&amp;" : std::string(1, c);
  return result;
}

std::string text_at(double x, double y, const std::string& anchor, const std::string& text,
                    const std::string& more = {}) {
  return "<text x=\"" + number(x) + "\" y=\"" + number(y) + "\" text-anchor=\"" + anchor + "\"" + more + ">" +
         escaped(text) + "</text>\n";
}

std::string line_between(double x1, double y1, double x2, double y2, const std::string& style) {
  return "<line x1=\"" + number(x1) + "\" y1=\"" + number(y1) + "\" x2=\"" + number(x2) + "\" y2=\"" +
         number(y2) + "\" " + style + "/>\n";
}

/// Names in the order they first appear; their place is their colour.
std::vector<std::string> names_in(const std::vector<Plot>& plots) {
  std::vector<std::string> names;
  for (const Plot& plot : plots)
    for (const PlotLine& line : plot.lines)
      if (std::find(names.begin(), names.end(), line.name) == names.end()) names.push_back(line.name);
  return names;
}

std::string colour_of(const std::vector<std::string>& names, const std::string& name) {
  const auto place = std::find(names.begin(), names.end(), name) - names.begin();
  return kColours[static_cast<std::size_t>(place) % std::size(kColours)];
}

/// One plot with its box at (left, top).
class Drawing {
 public:
  Drawing(const Plot& plot, double left, double top) : plot_(plot), left_(left), top_(top) {
    std::vector<double> xs, ys;
    for (const PlotLine& line : plot.lines) {
      for (const auto& point : line.points) {
        if (!drawable(point)) continue;
        xs.push_back(point.first);
        ys.push_back(point.second);
      }
    }
    x_ = decades_of(xs);
    y_ = decades_of(ys);
  }

  std::string axes() const {
    const std::string grid = "stroke=\"#ddd\"";
    std::string svg;
    for (int exponent = x_.low; exponent <= x_.high; ++exponent) {
      const double x = across(std::pow(10.0, exponent));
      svg += line_between(x, top_, x, top_ + kHeight, grid);
      svg += text_at(x, top_ + kHeight + 18, "middle", power_of_ten(exponent));
    }
    for (int exponent = y_.low; exponent <= y_.high; ++exponent) {
      const double y = down(std::pow(10.0, exponent));
      svg += line_between(left_, y, left_ + kWidth, y, grid);
      svg += text_at(left_ - 8, y + 4, "end", power_of_ten(exponent));
    }
    svg += "<rect x=\"" + number(left_) + "\" y=\"" + number(top_) + "\" width=\"" + number(kWidth) +
           "\" height=\"" + number(kHeight) + "\" fill=\"none\" stroke=\"#333\"/>\n";
    const double middle = left_ + 0.5 * kWidth, side = left_ - 50, half = top_ + 0.5 * kHeight;
    svg += text_at(middle, top_ - 14, "middle", plot_.title, " font-weight=\"bold\"");
    svg += text_at(middle, top_ + kHeight + 42, "middle", plot_.x_axis);
    svg += text_at(side, half, "middle", plot_.y_axis,
                   " transform=\"rotate(-90 " + number(side) + " " + number(half) + ")\"");
    return svg;
  }

  std::string line(const PlotLine& line, const std::string& colour) const {
    auto points = line.points;
    std::erase_if(points, [](const auto& point) { return !drawable(point); });
    std::sort(points.begin(), points.end());
    std::string places, dots;
    for (const auto& [x, y] : points) {
      places += number(across(x)) + "," + number(down(y)) + " ";
      dots += "<circle cx=\"" + number(across(x)) + "\" cy=\"" + number(down(y)) + "\" r=\"3\" fill=\"" +
              colour + "\"/>\n";
    }
    return "<polyline points=\"" + places + "\" fill=\"none\" stroke=\"" + colour +
           "\" stroke-width=\"2\"/>\n" + dots;
  }

 private:
  double across(double x) const { return left_ + kWidth * x_.place(x); }
  double down(double y) const { return top_ + kHeight * (1.0 - y_.place(y)); }

  const Plot& plot_;
  double left_, top_;
  Decades x_, y_;
};

}  // namespace

std::string svg_of(const std::vector<Plot>& plots) {
  const std::vector<std::string> names = names_in(plots);
  const double step = kLeft + kWidth + kRight;
  const double width = step * static_cast<double>(plots.size());
  const double legend_top = kTop + kHeight + kBottom;
  const double height = legend_top + kLegendRow * (std::ceil(static_cast<double>(names.size()) / 4.0) + 0.5);
  std::string svg = "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 " + number(width) + " " +
                    number(height) + "\" width=\"" + number(width) + "\" height=\"" + number(height) +
                    "\" font-family=\"sans-serif\" font-size=\"12\">\n"
                    "<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n";
  for (std::size_t k = 0; k < plots.size(); ++k) {
    const Drawing drawing(plots[k], static_cast<double>(k) * step + kLeft, kTop);
    svg += drawing.axes();
    for (const PlotLine& line : plots[k].lines) svg += drawing.line(line, colour_of(names, line.name));
  }
  for (std::size_t k = 0; k < names.size(); ++k) {
    const double x = kLeft + static_cast<double>(k % 4) * 150.0;
    const double y = legend_top + kLegendRow * static_cast<double>(k / 4);
    svg += line_between(x, y, x + 24, y, "stroke=\"" + colour_of(names, names[k]) + "\" stroke-width=\"3\"");
    svg += text_at(x + 30, y + 4, "start", names[k]);
  }
  return svg + "</svg>\n";
}

}  // namespace sinew
