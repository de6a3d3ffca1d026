#include "tools/bench/table.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace sinew {
namespace {

std::string padded(const std::string& text, std::size_t width, bool left) {
  const std::string space(width > text.size() ? width - text.size() : 0, ' ');
  return left ? text + space : space + text;
}

std::string line(const Table& table, const std::vector<std::string>& cells,
                 const std::vector<std::size_t>& widths) {
  std::string text;
  for (std::size_t column = 0; column < cells.size(); ++column) {
    if (column > 0) text += "  ";
    text += padded(cells[column], widths[column], column < table.text_columns);
  }
  text.erase(text.find_last_not_of(' ') + 1);
  return text + '\n';
}

std::string markdown_line(const std::vector<std::string>& cells) {
  std::string text = "|";
  for (const std::string& cell : cells) text += " " + cell + " |";
  return text + '\n';
}

}  // namespace

std::string to_text(const Table& table) {
  std::vector<std::size_t> widths;
  for (std::size_t column = 0; column < table.headings.size(); ++column) {
    widths.push_back(table.headings[column].size());
    for (const auto& row : table.rows) widths.back() = std::max(widths.back(), row[column].size());
  }
  std::string text = table.title + '\n' + line(table, table.headings, widths);
  for (const auto& row : table.rows) text += line(table, row, widths);
  return text;
}

std::string to_markdown(const Table& table) {
  std::string text = "**" + table.title + "**\n\n" + markdown_line(table.headings) + "|";
  for (std::size_t column = 0; column < table.headings.size(); ++column) {
    text += column < table.text_columns ? "---|" : "---:|";
  }
  text += '\n';
  for (const auto& row : table.rows) text += markdown_line(row);
  return text;
}

std::string figure(double value) {
  if (!std::isfinite(value)) return "-";
  const double size = std::abs(value);
  int decimals = 0;
  if (size > 0.0) decimals = std::clamp(2 - static_cast<int>(std::floor(std::log10(size))), 0, 7);
  char text[64];
  std::snprintf(text, sizeof text, "%.*f", decimals, value);
  return text;
}

std::string error_figure(double value) {
  char text[64];
  std::snprintf(text, sizeof text, "%.1e", value);
  return text;
}

}  // namespace sinew
