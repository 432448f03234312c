// SPDX-License-Identifier: MIT
// One row of a case, for tests: its results by name.
#pragma once

#include <map>
#include <sstream>
#include <string>

#include "tests/lab/study.h"

namespace rikiseki::lab::test {

struct RowResult {
  std::map<std::string, double> got;
  std::map<std::string, std::string> texts;
  RowStatus status = RowStatus::kOk;
};

/// Runs the first row of a table given as text, header line first.
inline RowResult RunText(const Case& study, const std::string& text, std::uint64_t seed = 1) {
  std::istringstream in(text);
  const Table table = Table::Read(in, "rows.csv");
  const Outcome outcome = study.run(table.row(0), seed);
  RowResult result;
  result.status = outcome.status;
  const std::size_t values = outcome.values.size();
  for (std::size_t i = 0; i < study.results.size(); ++i) {
    const std::string& name = study.results[i].name;
    if (i < values) result.got[name] = outcome.values[i];
    if (i >= values && i - values < outcome.texts.size()) {
      result.texts[name] = outcome.texts[i - values];
    }
  }
  return result;
}

}  // namespace rikiseki::lab::test
