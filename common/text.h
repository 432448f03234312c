// SPDX-License-Identifier: MIT
// What is done to text in more than one room.
#pragma once

#include <string>

namespace rikiseki {

/// Without blanks, tabs and carriage returns at either end.
inline std::string Trim(const std::string& text) {
  const auto first = text.find_first_not_of(" \t\r");
  if (first == std::string::npos) return "";
  return text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

/// For HTML, SVG and XML: &, <, >, " escaped.
std::string Escaped(const std::string& text);

}  // namespace rikiseki
