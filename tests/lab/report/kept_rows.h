// SPDX-License-Identifier: MIT
// The finished rows of a chapter on disk. A report that was stopped goes on from them, and one that
// was spread over computers is put together from them.
#pragma once

#include <filesystem>
#include <fstream>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "tests/lab/study.h"

namespace rikiseki::lab {

/// One row with what it gave, and the computer that ran it.
struct KeptRow {
  Outcome outcome;
  std::string machine;
};

/// FOLDER/NAME.csv and FOLDER/NAME.*.csv hold rows: inputs, got_ columns, got_texts (how many of the
/// results are no numbers), got_machine. The files may stand for shards, or be one file that was
/// concatenated from several: header lines in the middle are skipped, and so is a last line that was
/// cut when its writer was killed.
class KeptRows {
 public:
  /// Reads all files of that name. Throws ConfigError where one is of other rows than these, or
  /// cannot be read.
  KeptRows(const std::filesystem::path& folder, const std::string& name, const Case& study,
           const Table& rows);

  /// Null where the row is not finished.
  const KeptRow* Find(const Row& row) const;

  /// Opens the file that Keep appends to: NAME.csv, or with a part, such as 2-of-8, NAME.PART.csv.
  /// Throws ConfigError.
  void Open(const std::string& part);

  /// Appends a row at once, so that nothing is lost when the program is killed. Any thread.
  void Keep(const Row& row, const KeptRow& kept);

  /// Writes NAME.csv anew: the rows of the table, in their order, as far as they are finished.
  void Rewrite(const Table& rows);

 private:
  void Load(const std::filesystem::path& path);
  std::string Line(const Row& row, const KeptRow& kept) const;
  std::string Header() const;
  std::vector<std::string> InputsOf(const Row& row) const;

  std::filesystem::path folder_;
  std::string name_;
  std::vector<std::string> inputs_;   // columns
  std::vector<std::string> results_;  // columns, with got_
  std::map<std::vector<std::string>, KeptRow> kept_;
  std::mutex writing_;
  std::ofstream file_;
};

/// "AMD EPYC 7763, 2 cores, Linux 6.1".
std::string ThisMachine();

}  // namespace rikiseki::lab
