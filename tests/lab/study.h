// SPDX-License-Identifier: MIT
// A study runs one case over the rows of a table, on several threads, and sets what it computed
// beside what the table expects. Results do not depend on the number of threads or shards.
#pragma once

#include <cstdint>
#include <functional>
#include <iosfwd>
#include <string>
#include <string_view>
#include <vector>

#include "tests/lab/table.h"

namespace rikiseki::lab {

enum class RowStatus {
  kOk,           // computed; agrees with every result that the row expects
  kMissed,       // an expected result was missed by more than its tolerance
  kUnstable,     // the run diverged, and the row expects nothing else
  kUnsupported,  // a method that is not built, or a variant for study only
};

std::string_view StatusName(RowStatus status);

/// A result that a row may expect under `name`, and that the study writes as "got_" + name.
struct ResultColumn {
  std::string name;
  double tolerance = 0;  // absolute; the rounding of the expected text is allowed on top of it
};

/// What one row gave.
struct Outcome {
  RowStatus status = RowStatus::kOk;
  std::vector<double> values = {};  // one per result column; empty where nothing could be computed
  std::vector<std::string> texts = {};  // of the result columns after those, which are no numbers
};

/// One experiment of the laboratory. Each is a file of its own; main.cpp lists them.
struct Case {
  std::string name;
  std::string purpose;  // one line for --help
  std::vector<ResultColumn> results;

  /// Whether a table has the rows of this case. Cases with several row formats are several of one
  /// name, of which the first that takes the table runs it. Empty = takes any.
  std::function<bool(const Table& table)> takes;

  /// The rows that are run when no table is given: of several Cases of one name, those of the first.
  std::function<Table(bool quick)> grid;

  /// Computes one row: a pure function of its arguments, called from several threads. Throws
  /// ConfigError where the row makes no sense. Comparing is the study's: kMissed is returned only
  /// where a bar is broken that holds for every row.
  std::function<Outcome(const Row& row, std::uint64_t seed)> run;

  /// Whether result `index` is what the row expects of it, where more than the column's tolerance
  /// decides. Empty = that alone.
  std::function<bool(const Row& row, const Outcome& outcome, std::size_t index)> agrees;

  /// Prints what the rows say together.
  std::function<void(const Table& rows, const std::vector<Outcome>& outcomes, std::ostream& out)>
      summarise;

  /// Holds the rows of the case's own grid against each other: names every bar that is missed and
  /// returns how many are. May be absent.
  std::function<std::size_t(const Table& rows, const std::vector<Outcome>& outcomes,
                            std::ostream& out)>
      judge;
};

struct StudyOptions {
  int jobs = 1;
  int shard = 1;  // 1 .. shards: this one runs every row whose place modulo `shards` is shard - 1
  int shards = 1;
  std::uint64_t seed = 1;
};

struct StudyResult {
  Table rows;                     // of this shard, without older results of the same study
  std::vector<Outcome> outcomes;  // one per row, compared

  std::size_t Count(RowStatus status) const;
};

/// Runs the shard's rows and compares. Throws the ConfigError of the first row that makes no sense.
StudyResult RunStudy(const Case& study, const Table& table, const StudyOptions& options);

/// The rows as they were read, with the columns got_... and got_status appended.
void WriteStudy(const Case& study, const StudyResult& result, std::ostream& out);

/// The number that a row expects in a result column, which may be inf or nan. Throws ConfigError.
double ExpectedNumber(const Row& row, std::string_view column);

/// How far a number may lie from the true one just because it was written with at least nine
/// significant digits, trailing zeros left out: half a unit of its last digit. Throws
/// std::invalid_argument if it is no number.
double RoundingOf(const std::string& text);

}  // namespace rikiseki::lab
