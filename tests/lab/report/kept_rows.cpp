// SPDX-License-Identifier: MIT
#include "tests/lab/report/kept_rows.h"

#include <sys/utsname.h>

#include <algorithm>
#include <cstdlib>
#include <sstream>
#include <thread>

namespace rikiseki::lab {
namespace {

namespace fs = std::filesystem;

constexpr const char* kTexts = "got_texts";
constexpr const char* kMachine = "got_machine";
constexpr const char* kStatus = "got_status";

RowStatus StatusOf(const Row& row) {
  const std::string name = row.Text(kStatus);
  for (const RowStatus status :
       {RowStatus::kOk, RowStatus::kMissed, RowStatus::kUnstable, RowStatus::kUnsupported}) {
    if (name == StatusName(status)) return status;
  }
  row.Refuse(kStatus, "ok, missed, unstable or unsupported is expected");
}

// A table of one line, without its header.
std::string OneLine(const std::vector<std::string>& fields) {
  std::vector<std::string> columns;
  for (std::size_t i = 0; i < fields.size(); ++i) columns.push_back(std::to_string(i));
  Table table("a row", columns);
  table.Append(fields);
  std::ostringstream text;
  table.Write(text, {}, {{}});
  return text.str().substr(text.str().find('\n') + 1);
}

}  // namespace

std::string ThisMachine() {
  std::string model = "unknown processor";
  std::ifstream cpu("/proc/cpuinfo");
  for (std::string line; std::getline(cpu, line);) {
    if (!line.starts_with("model name")) continue;
    model = line.substr(std::min(line.size(), line.find(':') + 2));
    break;
  }
  utsname system{};
  uname(&system);
  return model + "; " + std::to_string(std::thread::hardware_concurrency()) + " cores; Linux " +
         system.release;
}

KeptRows::KeptRows(const fs::path& folder, const std::string& name, const Case& study,
                   const Table& rows)
    : folder_(folder), name_(name), inputs_(rows.columns()) {
  for (const ResultColumn& result : study.results) results_.push_back("got_" + result.name);
  std::erase_if(inputs_, [](const std::string& column) { return column.starts_with("got_"); });
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string file = entry.path().filename();
    if (file.starts_with(name + ".") && file.ends_with(".csv")) Load(entry.path());
  }
}

void KeptRows::Load(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  std::string whole;
  std::string header;
  for (std::string line; std::getline(in, line);) {
    if (in.eof()) break;  // no newline: it was cut
    if (header.empty()) {
      header = line;
    } else if (line == header) {
      continue;
    }
    whole += line + "\n";
  }
  if (header.empty()) return;
  if (header + "\n" != Header()) {
    throw ConfigError(path.string() + ":1: these are other columns than those of " + name_ +
                      "; remove the file, or choose another --out");
  }
  std::istringstream text(whole);
  const Table table = Table::Read(text, path);
  for (std::size_t i = 0; i < table.size(); ++i) {
    const Row row = table.row(i);
    KeptRow kept;
    kept.outcome.status = StatusOf(row);
    kept.machine = row.Text(kMachine);
    const auto texts = static_cast<std::size_t>(row.Integer(kTexts, 0, 100));
    if (row.Find(results_.front())) {
      for (std::size_t j = 0; j < results_.size(); ++j) {
        const std::string field = row.Find(results_[j]).value_or("");
        if (j + texts < results_.size()) {
          kept.outcome.values.push_back(std::strtod(field.c_str(), nullptr));
        } else {
          kept.outcome.texts.push_back(field);
        }
      }
    }
    kept_.insert_or_assign(InputsOf(row), std::move(kept));
  }
}

const KeptRow* KeptRows::Find(const Row& row) const {
  const auto found = kept_.find(InputsOf(row));
  return found == kept_.end() ? nullptr : &found->second;
}

void KeptRows::Open(const std::string& part) {
  const fs::path path = folder_ / (part.empty() ? name_ + ".csv" : name_ + "." + part + ".csv");
  std::ostringstream text;
  if (std::ifstream in(path, std::ios::binary); in) text << in.rdbuf();
  // What was cut is taken off: rows are appended behind the last whole line.
  const std::string whole = text.str().substr(0, text.str().rfind('\n') + 1);
  if (whole.empty() || whole.size() < text.str().size()) {
    std::ofstream(path, std::ios::binary) << (whole.empty() ? Header() : whole);
  }
  file_.open(path, std::ios::binary | std::ios::app);
  if (!file_) throw ConfigError(path.string() + ": cannot be written");
}

void KeptRows::Keep(const Row& row, const KeptRow& kept) {
  const std::string line = Line(row, kept);
  const std::lock_guard lock(writing_);
  file_ << line << std::flush;
  kept_.insert_or_assign(InputsOf(row), kept);
}

void KeptRows::Rewrite(const Table& rows) {
  if (file_.is_open()) file_.close();
  const fs::path path = folder_ / (name_ + ".csv");
  const fs::path next = folder_ / (name_ + ".csv.new");
  std::ofstream out(next, std::ios::binary);
  out << Header();
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (const KeptRow* kept = Find(rows.row(i))) out << Line(rows.row(i), *kept);
  }
  out.close();
  if (!out) throw ConfigError(next.string() + ": cannot be written");
  fs::rename(next, path);
}

std::string KeptRows::Header() const {
  std::vector<std::string> columns = inputs_;
  columns.insert(columns.end(), results_.begin(), results_.end());
  columns.insert(columns.end(), {kStatus, kTexts, kMachine});
  return OneLine(columns);
}

std::string KeptRows::Line(const Row& row, const KeptRow& kept) const {
  std::vector<std::string> fields = InputsOf(row);
  for (const double value : kept.outcome.values) fields.push_back(ToField(value));
  for (const std::string& text : kept.outcome.texts) fields.push_back(text);
  fields.resize(inputs_.size() + results_.size());
  fields.emplace_back(StatusName(kept.outcome.status));
  fields.push_back(std::to_string(kept.outcome.texts.size()));
  fields.push_back(kept.machine);
  return OneLine(fields);
}

std::vector<std::string> KeptRows::InputsOf(const Row& row) const {
  std::vector<std::string> inputs;
  for (const std::string& column : inputs_) inputs.push_back(row.Find(column).value_or(""));
  return inputs;
}

}  // namespace rikiseki::lab
