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

/// Likewise, against a single rate of the same haptic period [mm].
inline double SplitError(const ResultRow& row) {
  return 1e3 * row.Got("split_rms_m");
}

/// Of one core [%], of what diverged, too.
inline double Cpu(const ResultRow& row) {
  const auto found = row.got.find("cpu_s_per_s");
  return found == row.got.end() ? 0 : 100 * found->second;
}

/// The row with planes interpolated, second-order copies and an engine that steps at 1 ms; null if there is none.
inline const ResultRow* ErrorRow(const Results& results, const std::string& system,
                                 const std::string& coupling, const std::string& period,
                                 const std::string& world_period) {
  const std::string display = coupling == "local" ? "" : "interpolate";
  for (const ResultRow& row : RowsOf(results, "error-vs-runtime")) {
    const std::string substep = row.Text("substep_s");
    if (row.Text("system") == system && row.Text("coupling") == coupling &&
        row.Text("display") == display && row.Text("T_s") == period &&
        row.Text("Tw_s") == world_period && row.Text("body_step") != "semi_implicit" &&
        (substep.empty() || substep == "0.001")) {
      return &row;
    }
  }
  return nullptr;
}

}  // namespace rikiseki::lab
