// SPDX-License-Identifier: MIT
// The rows of error-vs-runtime as the sections read them.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "tests/lab/report/sections.h"

namespace rikiseki::lab {

inline const std::vector<std::pair<std::string, std::string>> kErrorSystems = {
    {"P", "P: a light hand pokes a block of 0.5 kg"},
    {"H", "H: a firm hand pushes a block of 2 kg"},
    {"offcentre", "A cube of 0.5 kg, pushed 10 mm off its middle"},
    {"corner", "A cube of 0.5 kg, the finger pressed to the floor"},
    {"stack", "A cube of 0.5 kg with 0.25 kg on top"}};

using ErrorRows = std::vector<const ResultRow*>;

inline ErrorRows ErrorRowsOf(const std::vector<ResultRow>& all, const std::string& system,
                             const std::string& coupling = "") {
  ErrorRows rows;
  for (const ResultRow& row : all) {
    if (row.Text("system") == system && (coupling.empty() || row.Text("coupling") == coupling)) {
      rows.push_back(&row);
    }
  }
  return rows;
}

/// Of where the push ended, against 20 us [mm].
inline double Error(const ResultRow& row) {
  return 1e3 * row.Got("continuous_rms_m");
}

/// Of one core [%], of what diverged, too.
inline double Cpu(const ResultRow& row) {
  const auto found = row.got.find("cpu_s_per_s");
  return found == row.got.end() ? 0 : 100 * found->second;
}

}  // namespace rikiseki::lab
