// SPDX-License-Identifier: MIT
#include "tests/lab/study.h"

#include <algorithm>
#include <atomic>
#include <charconv>
#include <cmath>
#include <exception>
#include <limits>
#include <ostream>
#include <stdexcept>
#include <thread>

namespace rikiseki::lab {
namespace {

double ParseNumber(const std::string& text) {
  double value = 0;
  const char* end = text.data() + text.size();
  const auto result = std::from_chars(text.data(), end, value);
  if (result.ec != std::errc() || result.ptr != end) {
    throw std::invalid_argument(text + " is not a number");
  }
  return value;
}

int SignificantDigits(const std::string& text) {
  int digits = 0;
  for (const char c : text) {
    if (c == 'e' || c == 'E') break;
    if (c >= '0' && c <= '9' && (digits > 0 || c != '0')) ++digits;
  }
  return digits;
}

// A reference that diverged (inf, nan) is met by a run that diverged.
bool Agrees(const ResultColumn& result, const std::string& expected_text, double got) {
  const double expected = ParseNumber(expected_text);
  if (!std::isfinite(expected)) return !std::isfinite(got);
  return std::abs(got - expected) <= result.tolerance + RoundingOf(expected_text);
}

void Compare(const Case& study, const Row& row, Outcome& outcome) {
  if (outcome.status == RowStatus::kUnsupported) return;
  for (std::size_t i = 0; i < study.results.size(); ++i) {
    const std::string& column = study.results[i].name;
    const auto expected = row.Find(column);
    if (!expected) continue;
    try {
      const bool agrees = study.agrees ? study.agrees(row, outcome, i)
                                       : Agrees(study.results[i], *expected, outcome.values.at(i));
      if (!agrees) outcome.status = RowStatus::kMissed;
    } catch (const std::invalid_argument&) {
      row.Refuse(column, "a number is expected");
    }
  }
}

std::vector<std::string> GotColumns(const Case& study) {
  std::vector<std::string> columns;
  for (const ResultColumn& result : study.results) columns.push_back("got_" + result.name);
  columns.push_back("got_status");
  return columns;
}

}  // namespace

std::string_view StatusName(RowStatus status) {
  switch (status) {
    case RowStatus::kOk:
      return "ok";
    case RowStatus::kMissed:
      return "missed";
    case RowStatus::kUnstable:
      return "unstable";
    case RowStatus::kUnsupported:
      return "unsupported";
  }
  return "";
}

double RoundingOf(const std::string& text) {
  const double value = std::abs(ParseNumber(text));
  if (value == 0 || !std::isfinite(value)) return 0;
  const int digits = std::max(9, SignificantDigits(text));
  return 0.5 * std::pow(10.0, std::floor(std::log10(value)) - (digits - 1));
}

std::size_t StudyResult::Count(RowStatus status) const {
  return static_cast<std::size_t>(
      std::count_if(outcomes.begin(), outcomes.end(),
                    [status](const Outcome& outcome) { return outcome.status == status; }));
}

double ExpectedNumber(const Row& row, std::string_view column) {
  try {
    return ParseNumber(row.Text(column));
  } catch (const std::invalid_argument&) {
    row.Refuse(column, "a number is expected");
  }
}

StudyResult RunStudy(const Case& study, const Table& table, const StudyOptions& options) {
  std::vector<std::size_t> indices;
  for (std::size_t i = static_cast<std::size_t>(options.shard - 1); i < table.size();
       i += static_cast<std::size_t>(options.shards)) {
    indices.push_back(i);
  }
  StudyResult result{table.Select(indices, GotColumns(study)), {}};
  result.outcomes.resize(result.rows.size());

  // Rows are handed out in order, so every row before a refused one has been started when it is
  // refused: the first refusal is the same for any number of threads.
  std::vector<std::exception_ptr> refusals(result.rows.size());
  std::atomic<std::size_t> next = 0;
  std::atomic<bool> refused = false;
  const auto work = [&] {
    while (!refused) {
      const std::size_t index = next++;
      if (index >= result.rows.size()) return;
      try {
        const Row row = result.rows.row(index);
        result.outcomes[index] = study.run(row, options.seed);
        Compare(study, row, result.outcomes[index]);
      } catch (...) {
        refusals[index] = std::current_exception();
        refused = true;
      }
    }
  };
  {
    std::vector<std::jthread> threads;
    for (int i = 1; i < options.jobs; ++i) threads.emplace_back(work);
    work();
  }
  for (const std::exception_ptr& refusal : refusals) {
    if (refusal) std::rethrow_exception(refusal);
  }
  return result;
}

void WriteStudy(const Case& study, const StudyResult& result, std::ostream& out) {
  std::vector<std::vector<std::string>> extra;
  for (const Outcome& outcome : result.outcomes) {
    std::vector<std::string> fields;
    for (std::size_t i = 0; i < study.results.size(); ++i) {
      const std::size_t values = outcome.values.size();
      const std::size_t text = i - values;  // read only where i >= values
      fields.push_back(i < values                    ? ToField(outcome.values[i])
                       : text < outcome.texts.size() ? outcome.texts[text]
                                                     : "");
    }
    fields.emplace_back(StatusName(outcome.status));
    extra.push_back(std::move(fields));
  }
  result.rows.Write(out, GotColumns(study), extra);
}

}  // namespace rikiseki::lab
