// SPDX-License-Identifier: MIT
#include "tests/lab/report/runner.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <exception>
#include <fstream>
#include <iomanip>
#include <limits>
#include <mutex>
#include <ostream>
#include <sstream>
#include <thread>

#include "common/version.h"
#include "tests/lab/report/kept_rows.h"

namespace rikiseki::lab {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

// Rows of two builds, seeds or sizes must not stand in one report.
void ClaimFolder(const RunnerOptions& options) {
  fs::create_directories(options.folder);
  const std::string mine = std::string(kVersion) + " (" + kBuild + "), seed " +
                           std::to_string(options.seed) + ", " + options.size + "\n";
  const fs::path path = options.folder / "made_by.txt";
  std::ifstream in(path);
  if (in) {
    std::ostringstream text;
    text << in.rdbuf();
    if (text.str() != mine) {
      std::string theirs = text.str();
      while (!theirs.empty() && theirs.back() == '\n') theirs.pop_back();
      throw ConfigError(path.string() + ": the rows here are of haptic_lab " + theirs +
                        "; remove the folder, or choose another --out");
    }
    return;
  }
  std::ofstream out(path);
  out << mine;
  if (!out) throw ConfigError(path.string() + ": cannot be written");
}

// How much is done, and how long the rest may take at the pace so far.
class Progress {
 public:
  Progress(double all_s, std::ostream& out) : all_s_(all_s), out_(out) {}

  void RowDone(const Chapter& chapter, std::size_t done, std::size_t of) {
    const std::lock_guard lock(mutex_);
    done_s_ += chapter.row_s;
    const auto now = Clock::now();
    if (done < of && now - told_ < std::chrono::seconds(5)) return;
    told_ = now;
    const double taken_s = std::chrono::duration<double>(now - start_).count();
    const double left_s = taken_s * (all_s_ - done_s_) / done_s_;
    out_ << std::left << std::setw(32) << chapter.name << std::right << std::setw(5) << done << "/"
         << std::left << std::setw(5) << of << std::right << std::setw(4)
         << std::lround(100 * done_s_ / all_s_) << " %, about " << std::lround(std::ceil(left_s))
         << " s left" << std::endl;
  }

 private:
  std::mutex mutex_;
  double all_s_;
  double done_s_ = 0;
  std::ostream& out_;
  Clock::time_point start_ = Clock::now();
  Clock::time_point told_ = start_;
};

std::vector<std::size_t> Unfinished(const Chapter& chapter, const KeptRows& kept,
                                    const RunnerOptions& options) {
  std::vector<std::size_t> indices;
  for (std::size_t i = static_cast<std::size_t>(options.shard - 1); i < chapter.rows.size();
       i += static_cast<std::size_t>(options.shards)) {
    if (kept.Find(chapter.rows.row(i)) == nullptr) indices.push_back(i);
  }
  return indices;
}

void RunChapter(const Chapter& chapter, KeptRows& kept, const std::vector<std::size_t>& indices,
                const RunnerOptions& options, Progress& progress) {
  const std::string machine = ThisMachine();
  std::atomic<std::size_t> next = 0;
  std::atomic<std::size_t> done = 0;
  std::mutex mutex;
  std::exception_ptr refusal;
  const auto work = [&] {
    for (std::size_t i = next++; i < indices.size(); i = next++) {
      try {
        const Table one = chapter.rows.Select({indices[i]}, {});
        const StudyResult result = RunStudy(chapter.study, one, {.seed = options.seed});
        kept.Keep(one.row(0), {result.outcomes.front(), machine});
        progress.RowDone(chapter, ++done, indices.size());
      } catch (...) {
        const std::lock_guard lock(mutex);
        if (!refusal) refusal = std::current_exception();
        next = indices.size();
      }
    }
  };
  {
    std::vector<std::jthread> threads;
    for (int i = 1; i < (chapter.alone ? 1 : options.jobs); ++i) threads.emplace_back(work);
    work();
  }
  if (refusal) std::rethrow_exception(refusal);
}

}  // namespace

std::string ResultRow::Text(const std::string& column) const {
  const auto found = in.find(column);
  return found == in.end() ? "" : found->second;
}

double ResultRow::Number(const std::string& column) const {
  const std::string text = Text(column);
  char* end = nullptr;
  const double value = std::strtod(text.c_str(), &end);
  return end == text.c_str() ? std::numeric_limits<double>::quiet_NaN() : value;
}

double ResultRow::Got(const std::string& column) const {
  const auto found = got.find(column);
  if (found == got.end() || diverged()) return std::numeric_limits<double>::infinity();
  return found->second;
}

void RunChapters(const std::vector<Chapter>& chapters, const RunnerOptions& options,
                 std::ostream& out) {
  ClaimFolder(options);
  double all_s = 0;
  for (const Chapter& chapter : chapters) {
    const KeptRows kept(options.folder, chapter.name, chapter.study, chapter.rows);
    all_s += chapter.row_s * static_cast<double>(Unfinished(chapter, kept, options).size());
  }
  Progress progress(all_s, out);
  const std::string part =
      options.shards == 1 ? ""
                          : std::to_string(options.shard) + "-of-" + std::to_string(options.shards);
  for (const Chapter& chapter : chapters) {
    KeptRows kept(options.folder, chapter.name, chapter.study, chapter.rows);
    const std::vector<std::size_t> indices = Unfinished(chapter, kept, options);
    if (!indices.empty()) {
      kept.Open(part);
      RunChapter(chapter, kept, indices, options, progress);
    }
    if (part.empty()) kept.Rewrite(chapter.rows);
  }
}

Results ReadResults(const std::vector<Chapter>& chapters, const fs::path& folder,
                    std::size_t& missing) {
  Results results;
  missing = 0;
  for (const Chapter& chapter : chapters) {
    const KeptRows kept(folder, chapter.name, chapter.study, chapter.rows);
    std::vector<ResultRow>& rows = results[chapter.name];
    for (std::size_t i = 0; i < chapter.rows.size(); ++i) {
      const Row row = chapter.rows.row(i);
      const KeptRow* found = kept.Find(row);
      if (found == nullptr) {
        ++missing;
        continue;
      }
      ResultRow result;
      result.status = found->outcome.status;
      result.machine = found->machine;
      for (const std::string& column : chapter.rows.columns()) {
        if (const auto text = row.Find(column)) result.in[column] = *text;
      }
      const std::size_t values = found->outcome.values.size();
      for (std::size_t j = 0; j < chapter.study.results.size(); ++j) {
        const std::string& name = chapter.study.results[j].name;
        if (j < values) {
          result.got[name] = found->outcome.values[j];
        } else if (j - values < found->outcome.texts.size()) {
          result.texts[name] = found->outcome.texts[j - values];
        }
      }
      rows.push_back(std::move(result));
    }
  }
  return results;
}

}  // namespace rikiseki::lab
