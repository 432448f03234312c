// The one thing that all readers of text files do.
#pragma once

#include <string>

namespace rikiseki {

/// Without blanks, tabs and carriage returns at either end.
inline std::string Trim(const std::string& text) {
  const auto first = text.find_first_not_of(" \t\r");
  if (first == std::string::npos) return "";
  return text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

}  // namespace rikiseki
