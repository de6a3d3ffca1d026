#pragma once

#include <string>
#include <vector>

namespace sinew {

/// Rows of text under headings, for a terminal or for Markdown.
struct Table {
  std::string title;
  std::vector<std::string> headings;
  std::vector<std::vector<std::string>> rows;  ///< as many cells each as there are headings
  std::size_t text_columns = 1;                ///< the first columns, which hold words; numbers follow
};

/// Columns under each other: words to the left, numbers to the right.
std::string to_text(const Table& table);
std::string to_markdown(const Table& table);

/// A number in three significant digits without exponent: "0.0123", "1.23", "1230".
std::string figure(double value);

/// Two digits and an exponent, for errors: "1.3e-04".
std::string error_figure(double value);

}  // namespace sinew
