// SPDX-License-Identifier: MIT
// Reads a file of reference rows: `#` lines skipped, then a header, then rows by column name.
#pragma once

#include <fstream>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace rikiseki::haptic {

using CsvRow = std::map<std::string, std::string>;

inline std::vector<CsvRow> ReadCsv(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw std::runtime_error("cannot read " + path);
  const auto split = [](const std::string& line) {
    std::vector<std::string> fields;
    std::istringstream stream(line);
    for (std::string field; std::getline(stream, field, ',');) fields.push_back(field);
    return fields;
  };
  std::vector<std::string> names;
  std::vector<CsvRow> rows;
  for (std::string line; std::getline(file, line);) {
    if (line.empty() || line[0] == '#') continue;
    const auto fields = split(line);
    if (names.empty()) {
      names = fields;
      continue;
    }
    CsvRow row;
    for (std::size_t i = 0; i < fields.size(); ++i) row[names.at(i)] = fields[i];
    rows.push_back(row);
  }
  return rows;
}

}  // namespace rikiseki::haptic
