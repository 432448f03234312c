// SPDX-License-Identifier: MIT
// CSV tables with named columns (RFC 4180): what a study reads and writes. Fields that nobody asks
// about pass through byte by byte. Every refusal is a ConfigError (exit status 78) naming file and
// line.
#pragma once

#include <cstddef>
#include <istream>
#include <optional>
#include <ostream>
#include <string>
#include <string_view>
#include <vector>

#include "common/config.h"

namespace rikiseki::lab {

class Table;

/// One row of a table. Cheap to copy; the table outlives it.
class Row {
 public:
  Row(const Table& table, std::size_t index) : table_(&table), index_(index) {}

  /// The field without quotes and surrounding blanks; nothing if there is no such column or it is
  /// empty.
  std::optional<std::string> Find(std::string_view column) const;

  /// The field as text, which must be there. Throws ConfigError.
  std::string Text(std::string_view column) const;

  /// The field as a finite number within [low, high]. Throws ConfigError naming column, value and
  /// range.
  double Number(std::string_view column, double low, double high) const;
  double NumberOr(std::string_view column, double low, double high, double otherwise) const;
  int Integer(std::string_view column, int low, int high) const;

  /// Throws a ConfigError that names file, line, column and value of this row.
  [[noreturn]] void Refuse(std::string_view column, const std::string& why) const;

  const Table& table() const { return *table_; }

 private:
  double Parse(std::string_view column, const std::string& text) const;

  const Table* table_;
  std::size_t index_;
};

class Table {
 public:
  /// An empty table, for rows that come from code; `name` stands for the file in errors.
  Table(std::string name, std::vector<std::string> columns);

  /// Reads a table with a header line. Throws ConfigError.
  static Table Read(std::istream& in, const std::string& name);
  static Table Load(const std::string& path);

  const std::string& name() const { return name_; }
  const std::vector<std::string>& columns() const { return columns_; }
  std::size_t size() const { return rows_.size(); }
  Row row(std::size_t index) const { return {*this, index}; }
  bool Has(std::string_view column) const { return ColumnIndex(column).has_value(); }

  /// Appends a row of plain values, as many as there are columns.
  void Append(const std::vector<std::string>& values);

  /// The same table with only the rows of `indices`, and without the columns of `dropped`.
  Table Select(const std::vector<std::size_t>& indices,
               const std::vector<std::string>& dropped) const;

  /// Writes every field as it was read, followed by `extra`, which has a line for each row.
  void Write(std::ostream& out, const std::vector<std::string>& extra_columns,
             const std::vector<std::vector<std::string>>& extra) const;

 private:
  friend class Row;
  struct Field {
    std::string raw;    // as it stands in the file
    std::string value;  // without quotes and surrounding blanks
  };
  struct Record {
    std::size_t line = 0;  // where it begins; 0 = it comes from code
    std::vector<Field> fields;
  };

  static bool ReadRecord(std::istream& in, const std::string& name, std::size_t& line,
                         Record& record);
  std::optional<std::size_t> ColumnIndex(std::string_view column) const;
  std::string Place(const Record& record) const;

  std::string name_;
  std::vector<std::string> columns_;
  std::vector<std::string> raw_columns_;
  std::vector<Record> rows_;
};

/// A number as it goes into a table: the shortest text that reads back to the same double.
std::string ToField(double value);

}  // namespace rikiseki::lab
