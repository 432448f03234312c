// SPDX-License-Identifier: MIT
#include "tests/lab/report/sections.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <set>
#include <sstream>

namespace rikiseki::lab {

const std::vector<ResultRow>& RowsOf(const Results& results, const std::string& chapter) {
  static const std::vector<ResultRow> none;
  const auto found = results.find(chapter);
  return found == results.end() ? none : found->second;
}

std::string Value(double value, const std::string& unit) {
  return std::isfinite(value) ? Short(value) + unit : "diverged";
}

const ResultRow* FindRow(const std::vector<ResultRow>& rows,
                         const std::vector<std::pair<std::string, std::string>>& columns) {
  for (const ResultRow& row : rows) {
    const bool fits = std::all_of(columns.begin(), columns.end(), [&](const auto& column) {
      return row.Text(column.first) == column.second;
    });
    if (fits) return &row;
  }
  return nullptr;
}

std::size_t CountMissed(const std::vector<ResultRow>& rows) {
  return static_cast<std::size_t>(std::count_if(rows.begin(), rows.end(), [](const ResultRow& row) {
    return row.status == RowStatus::kMissed;
  }));
}

std::vector<MassInterval> StableIntervals(const ResultRow& row) {
  std::vector<MassInterval> intervals;
  const auto text = row.texts.find("stable_intervals_kg_in_1e-5..1e4");
  if (text == row.texts.end()) return intervals;
  std::istringstream parts(text->second);
  for (std::string part; std::getline(parts, part, ';');) {
    const std::size_t dots = part.find("..");
    if (dots == std::string::npos) continue;
    intervals.push_back(
        {std::strtod(part.c_str(), nullptr), std::strtod(part.c_str() + dots + 2, nullptr)});
  }
  return intervals;
}

std::string StableMasses(const ResultRow& row) {
  std::string text;
  for (const MassInterval& interval : StableIntervals(row)) {
    text += (text.empty() ? "" : ", ") + Short(interval.from_kg) +
            (std::isfinite(interval.to_kg) ? " to " + Short(interval.to_kg) : " and more");
  }
  return text.empty() ? "none" : text;
}

double SpreadOf(const std::vector<ResultRow>& rows, const std::string& hand,
                const std::string& mass, const std::string& world_period,
                const std::string& coupling, std::size_t& subjects) {
  double squares = 0;
  subjects = 0;
  for (const ResultRow& row : rows) {
    if (row.Text("hand") != hand || row.Text("mass_kg") != mass ||
        row.Text("Tw_s") != world_period || row.Text("coupling") != coupling) {
      continue;
    }
    ++subjects;
    squares += std::pow(row.Got("stop_sd_m"), 2);
  }
  if (subjects == 0) return std::numeric_limits<double>::quiet_NaN();
  return std::sqrt(squares / static_cast<double>(subjects));
}

void Repeat(const std::string& command, const std::string& chapter,
            const std::vector<ResultRow>& rows, Html& page) {
  std::set<std::string> machines;
  for (const ResultRow& row : rows) machines.insert(row.machine);
  std::string text;
  for (const std::string& machine : machines) text += (text.empty() ? "" : "; ") + machine;
  page.Command("haptic_lab " + command + " --cases " + chapter + ".csv --out again.csv", text);
}

}  // namespace rikiseki::lab
