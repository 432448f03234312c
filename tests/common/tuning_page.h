// SPDX-License-Identifier: MIT
// config/README.md lists every key of both daemons: its value, range and effect, and whether the running
// loop takes it.
#pragma once

#include <algorithm>
#include <catch2/catch.hpp>
#include <fstream>
#include <string>
#include <vector>

namespace rikiseki {

/// The page must have one row for this key, marked live if it is one of `live`, and saying its effect.
inline void CheckTuningPage(const std::string& key, const std::vector<std::string>& live) {
  CAPTURE(key);
  std::ifstream page(std::string(RIKISEKI_SOURCE_DIR) + "/config/README.md");
  std::vector<std::string> rows;
  for (std::string line; std::getline(page, line);) {
    if (line.starts_with("| `" + key + "` |")) rows.push_back(line);
  }
  // loop.rate_hz is a key of both daemons.
  REQUIRE(rows.size() == (key == "loop.rate_hz" ? 2 : 1));
  const bool is_live = std::find(live.begin(), live.end(), key) != live.end();
  for (const std::string& row : rows) {
    CHECK((row.find("| live |") != std::string::npos) == is_live);
    CHECK(row.ends_with(". |"));
  }
}

}  // namespace rikiseki
