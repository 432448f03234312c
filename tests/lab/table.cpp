// SPDX-License-Identifier: MIT
#include "tests/lab/table.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <fstream>

namespace rikiseki::lab {
namespace {

constexpr std::string_view kBlank = " \t";

std::string Trim(std::string_view text) {
  const auto first = text.find_first_not_of(kBlank);
  if (first == std::string_view::npos) return "";
  return std::string(text.substr(first, text.find_last_not_of(kBlank) - first + 1));
}

std::string Quoted(const std::string& value) {
  if (value.find_first_of(",\"\r\n") == std::string::npos && Trim(value) == value) return value;
  std::string text = "\"";
  for (const char c : value) text += c == '"' ? "\"\"" : std::string(1, c);
  return text + "\"";
}

// The value of a raw field, or nothing if its quotes are not those of CSV.
std::optional<std::string> Unquote(const std::string& raw) {
  const std::string text = Trim(raw);
  if (text.find('"') == std::string::npos) return text;
  if (text.size() < 2 || text.front() != '"' || text.back() != '"') return std::nullopt;
  std::string value;
  for (std::size_t i = 1; i + 1 < text.size(); ++i) {
    if (text[i] == '"') {
      if (i + 2 >= text.size() || text[i + 1] != '"') return std::nullopt;
      ++i;
    }
    value += text[i];
  }
  return value;
}

}  // namespace

std::string ToField(double value) {
  std::array<char, 32> text{};
  return {text.data(), std::to_chars(text.data(), text.data() + text.size(), value).ptr};
}

std::optional<std::string> Row::Find(std::string_view column) const {
  const auto index = table_->ColumnIndex(column);
  if (!index) return std::nullopt;
  const std::string& value = table_->rows_[index_].fields[*index].value;
  if (value.empty()) return std::nullopt;
  return value;
}

std::string Row::Text(std::string_view column) const {
  const auto text = Find(column);
  if (!text) {
    throw ConfigError(table_->Place(table_->rows_[index_]) + ": column " + std::string(column) +
                      (table_->Has(column) ? " is empty" : " is missing"));
  }
  return *text;
}

void Row::Refuse(std::string_view column, const std::string& why) const {
  throw ConfigError(table_->Place(table_->rows_[index_]) + ": " + std::string(column) + " = " +
                    Find(column).value_or("") + ": " + why);
}

double Row::Parse(std::string_view column, const std::string& text) const {
  double value = 0;
  const char* end = text.data() + text.size();
  const auto result = std::from_chars(text.data(), end, value);
  if (result.ec != std::errc() || result.ptr != end) Refuse(column, "a number is expected");
  return value;
}

double Row::Number(std::string_view column, double low, double high) const {
  const double value = Parse(column, Text(column));
  if (!(value >= low && value <= high)) {
    Refuse(column, "a number from " + ToField(low) + " to " + ToField(high) + " is expected");
  }
  return value;
}

double Row::NumberOr(std::string_view column, double low, double high, double otherwise) const {
  return Find(column) ? Number(column, low, high) : otherwise;
}

int Row::Integer(std::string_view column, int low, int high) const {
  const double value = Number(column, low, high);
  if (value != std::floor(value)) Refuse(column, "a whole number is expected");
  return static_cast<int>(value);
}

Table::Table(std::string name, std::vector<std::string> columns)
    : name_(std::move(name)), columns_(std::move(columns)) {
  for (const std::string& column : columns_) raw_columns_.push_back(Quoted(column));
}

// One record, which quotes may stretch over several lines. Empty lines are skipped.
bool Table::ReadRecord(std::istream& in, const std::string& name, std::size_t& line,
                       Record& record) {
  std::string text;
  std::string piece;
  record = Record{};
  bool inside_quotes = false;
  while (std::getline(in, piece)) {
    ++line;
    if (!piece.empty() && piece.back() == '\r') piece.pop_back();
    if (!inside_quotes) {
      if (Trim(piece).empty()) continue;
      record.line = line;
      text = piece;
    } else {
      text += "\n" + piece;
    }
    inside_quotes = std::count(text.begin(), text.end(), '"') % 2 != 0;
    if (!inside_quotes) break;
  }
  if (record.line == 0) return false;
  const std::string place = name + ":" + std::to_string(record.line);
  if (inside_quotes) throw ConfigError(place + ": a quote is opened and never closed");

  std::size_t begin = 0;
  for (std::size_t i = 0; i <= text.size(); ++i) {
    if (i < text.size() && text[i] == '"') inside_quotes = !inside_quotes;
    if (i < text.size() && (inside_quotes || text[i] != ',')) continue;
    const std::string raw = text.substr(begin, i - begin);
    const auto value = Unquote(raw);
    if (!value) {
      throw ConfigError(place + ": " + Trim(raw) +
                        ": a quoted field is \"...\", a quote in it \"\"");
    }
    record.fields.push_back({raw, *value});
    begin = i + 1;
  }
  return true;
}

Table Table::Read(std::istream& in, const std::string& name) {
  constexpr std::array<char, 3> kByteOrderMark{'\xEF', '\xBB', '\xBF'};
  for (std::size_t i = 0;
       i < kByteOrderMark.size() && in.peek() != std::istream::traits_type::eof() &&
       static_cast<char>(in.peek()) == kByteOrderMark[i];
       ++i) {
    in.get();
  }
  Table table(name, {});
  std::size_t line = 0;
  Record record;
  if (!ReadRecord(in, name, line, record)) {
    throw ConfigError(name + ": a line with the names of the columns is expected");
  }
  for (const Field& field : record.fields) {
    const std::string place = name + ":" + std::to_string(record.line);
    if (field.value.empty()) throw ConfigError(place + ": a column has no name");
    if (table.Has(field.value)) {
      throw ConfigError(place + ": column " + field.value + " stands twice");
    }
    table.columns_.push_back(field.value);
    table.raw_columns_.push_back(field.raw);
  }
  while (ReadRecord(in, name, line, record)) {
    if (record.fields.size() != table.columns_.size()) {
      throw ConfigError(table.Place(record) + ": " + std::to_string(record.fields.size()) +
                        " fields; the header has " + std::to_string(table.columns_.size()));
    }
    table.rows_.push_back(record);
  }
  return table;
}

Table Table::Load(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  if (!in || in.peek() == std::ifstream::traits_type::eof()) {
    throw ConfigError(path + ": the table cannot be read, or is empty");
  }
  return Read(in, path);
}

void Table::Append(const std::vector<std::string>& values) {
  if (values.size() != columns_.size()) throw std::invalid_argument("Table::Append: wrong width");
  Record record;
  for (const std::string& value : values) record.fields.push_back({Quoted(value), value});
  rows_.push_back(std::move(record));
}

Table Table::Select(const std::vector<std::size_t>& indices,
                    const std::vector<std::string>& dropped) const {
  std::vector<std::size_t> kept;
  for (std::size_t i = 0; i < columns_.size(); ++i) {
    if (std::find(dropped.begin(), dropped.end(), columns_[i]) == dropped.end()) kept.push_back(i);
  }
  Table selected(name_, {});
  for (const std::size_t column : kept) {
    selected.columns_.push_back(columns_[column]);
    selected.raw_columns_.push_back(raw_columns_[column]);
  }
  for (const std::size_t index : indices) {
    Record record{rows_.at(index).line, {}};
    for (const std::size_t column : kept) record.fields.push_back(rows_[index].fields[column]);
    selected.rows_.push_back(std::move(record));
  }
  return selected;
}

void Table::Write(std::ostream& out, const std::vector<std::string>& extra_columns,
                  const std::vector<std::vector<std::string>>& extra) const {
  const char* separator = "";
  const auto put = [&](const std::string& text) {
    out << separator << text;
    separator = ",";
  };
  for (const std::string& column : raw_columns_) put(column);
  for (const std::string& column : extra_columns) put(Quoted(column));
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    separator = "\n";
    for (const Field& field : rows_[i].fields) put(field.raw);
    for (const std::string& value : extra.at(i)) put(Quoted(value));
  }
  out << "\n";
}

std::optional<std::size_t> Table::ColumnIndex(std::string_view column) const {
  const auto found = std::find(columns_.begin(), columns_.end(), column);
  if (found == columns_.end()) return std::nullopt;
  return static_cast<std::size_t>(found - columns_.begin());
}

std::string Table::Place(const Record& record) const {
  return record.line == 0 ? name_ : name_ + ":" + std::to_string(record.line);
}

}  // namespace rikiseki::lab
