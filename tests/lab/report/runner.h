// SPDX-License-Identifier: MIT
// Runs the report's chapters: what is finished is kept, progress is told, shards are parts of it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <iosfwd>
#include <map>
#include <string>
#include <vector>

#include "tests/lab/report/plan.h"

namespace rikiseki::lab {

struct RunnerOptions {
  std::filesystem::path folder;
  std::string size = "full";  // or quick: their rows do not share a folder
  int jobs = 1;
  int shard = 1;  // as of StudyOptions: of each chapter every row in its place
  int shards = 1;
  std::uint64_t seed = 1;
};

/// One finished row, by the names of its columns.
struct ResultRow {
  std::map<std::string, std::string> in;
  std::map<std::string, double> got;         // without "got_"
  std::map<std::string, std::string> texts;  // likewise: results that are no numbers
  RowStatus status = RowStatus::kOk;
  std::string machine;

  /// An input as text, empty where there is none; as a number, nan where it is none.
  std::string Text(const std::string& column) const;
  double Number(const std::string& column) const;
  /// A result; not finite where the run diverged.
  double Got(const std::string& column) const;
  bool diverged() const { return status == RowStatus::kUnstable; }
};
using Results = std::map<std::string, std::vector<ResultRow>>;  // by chapter

/// Runs what is not finished yet, of this shard. Progress goes to `out`. Throws ConfigError where the
/// folder holds the rows of another build, seed or size.
void RunChapters(const std::vector<Chapter>& chapters, const RunnerOptions& options,
                 std::ostream& out);

/// What is finished, in the order of the plan; `missing` is how many rows are not.
Results ReadResults(const std::vector<Chapter>& chapters, const std::filesystem::path& folder,
                    std::size_t& missing);

}  // namespace rikiseki::lab
