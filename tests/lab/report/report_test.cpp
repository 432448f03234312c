// SPDX-License-Identifier: MIT
// The report as a whole, on a few rows of each chapter: it is stopped and goes on, is spread and put
// together, and gives the same numbers every time.
#include "tests/lab/report/report.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <fstream>
#include <sstream>

#include "tests/common/temporary_folder.h"
#include "tests/lab/report/plan.h"

namespace rikiseki::lab {
namespace {

namespace fs = std::filesystem;

fs::path PathOf(const TemporaryFolder& folder) {
  return folder.File("");
}

// A few cheap rows of each chapter.
std::vector<Chapter> FewRows() {
  std::vector<Chapter> chapters = ReportPlan(true);
  for (Chapter& chapter : chapters) {
    std::vector<std::size_t> kept;
    const std::size_t wanted = chapter.name == "fig9" || chapter.name == "pushes" ? 4 : 3;
    for (std::size_t i = 0; i < chapter.rows.size() && kept.size() < wanted; ++i) {
      if (chapter.name != "error-vs-runtime" || chapter.rows.row(i).Text("system") == "H") {
        kept.push_back(i);
      }
    }
    chapter.rows = chapter.rows.Select(kept, {});
  }
  return chapters;
}

std::string ReadAll(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

bool IsTime(const std::string& column) {
  return column == "got_cpu_s_per_s" || column.ends_with("_us") ||
         column.starts_with("got_world_us_");
}

// Every field of every row but the times; "" where there is no such file.
std::string WithoutTimes(const fs::path& path) {
  const Table table = Table::Load(path);
  std::string text;
  for (const std::string& column : table.columns()) {
    if (IsTime(column)) continue;
    text += column + ":";
    for (std::size_t i = 0; i < table.size(); ++i) {
      text += table.row(i).Find(column).value_or("") + ";";
    }
    text += "\n";
  }
  return text;
}

std::size_t Make(const std::vector<Chapter>& chapters, const fs::path& folder, int shard = 1,
                 int shards = 1, std::string* said = nullptr) {
  std::ostringstream out;
  const std::size_t missed =
      MakeReport(chapters, {.folder = folder, .jobs = 2, .shard = shard, .shards = shards}, out);
  if (said != nullptr) *said = out.str();
  return missed;
}

}  // namespace

TEST_CASE("report: a page of one file, with every section, and every reference row met") {
  const TemporaryFolder folder;
  CHECK(Make(FewRows(), PathOf(folder)) == 0);
  const std::string page = ReadAll(PathOf(folder) / "index.html");
  for (const char* words :
       {"Which stiffness is stable on my device", "How light may an object be",
        "What does a world at 10 Hz cost", "What would a faster haptic loop buy",
        "Error against run time", "Stability", "What scenes leave out", "Fig. 6", "Figs. 8 and 9",
        "Against others", "Every reference row", "prefers-color-scheme: dark", "<svg", "run on "}) {
    CAPTURE(words);
    CHECK(page.find(words) != std::string::npos);
  }
  for (const char* outside : {"http:", "https:", "src=", "url(", "<script", "nan mm"}) {
    CAPTURE(outside);
    CHECK(page.find(outside) == std::string::npos);
  }
  CHECK(page.find("rows are missing") == std::string::npos);

  SECTION("again: nothing is run, the page is the same") {
    std::string said;
    Make(FewRows(), PathOf(folder), 1, 1, &said);
    CHECK(said.find("% ") == std::string::npos);
    CHECK(ReadAll(PathOf(folder) / "index.html") == page);
  }

  SECTION("from nothing, in two shards: the same numbers to the last digit, but for times") {
    const TemporaryFolder first;
    const TemporaryFolder second;
    std::string said;
    Make(FewRows(), PathOf(first), 1, 2, &said);
    CHECK(said.find("rows are missing: run the other shards") != std::string::npos);
    CHECK(ReadAll(PathOf(first) / "index.html").find("rows are missing") != std::string::npos);
    Make(FewRows(), PathOf(second), 2, 2);
    for (const auto& entry : fs::directory_iterator(PathOf(second))) {
      if (entry.path().extension() == ".csv") fs::copy(entry.path(), PathOf(first));
    }
    Make(FewRows(), PathOf(first), 1, 1, &said);
    CHECK(said.find("missing") == std::string::npos);
    CHECK(said.find("% ") == std::string::npos);  // nothing was left to run
    for (const Chapter& chapter : FewRows()) {
      CAPTURE(chapter.name);
      const std::string file = chapter.name + ".csv";
      CHECK(WithoutTimes(PathOf(first) / file) == WithoutTimes(PathOf(folder) / file));
    }
  }

  SECTION("rows of another seed or size are refused") {
    std::ostringstream out;
    CHECK_THROWS_WITH(MakeReport(FewRows(), {.folder = PathOf(folder), .seed = 2}, out),
                      Catch::Contains("made_by.txt: the rows here are of haptic_lab"));
    CHECK_THROWS_AS(MakeReport(FewRows(), {.folder = PathOf(folder), .size = "quick"}, out),
                    ConfigError);
  }
}

TEST_CASE("report: what was finished when it was stopped is not run again") {
  int runs = 0;
  Case study;
  study.name = "counting";
  study.results = {{"twice"}};
  study.run = [&runs](const Row& row, std::uint64_t) {
    ++runs;
    if (runs == 3) throw ConfigError("stopped");
    return Outcome{RowStatus::kOk, {2 * row.Number("a", 0, 10)}};
  };
  Table rows("rows", {"a"});
  for (int i = 0; i < 5; ++i) rows.Append({std::to_string(i)});
  const std::vector<Chapter> chapters = {{.name = "counting", .study = study, .rows = rows}};
  const TemporaryFolder folder;
  const RunnerOptions options{.folder = PathOf(folder)};
  std::ostringstream out;
  CHECK_THROWS_AS(RunChapters(chapters, options, out), ConfigError);
  RunChapters(chapters, options, out);
  CHECK(runs == 6);  // two, one that failed, three
  std::size_t missing = 1;
  const Results results = ReadResults(chapters, PathOf(folder), missing);
  CHECK(missing == 0);
  REQUIRE(results.at("counting").size() == 5);
  for (std::size_t i = 0; i < 5; ++i) {
    CHECK(results.at("counting")[i].Got("twice") == 2.0 * static_cast<double>(i));
  }
}

TEST_CASE("report: both plans have rows for every chapter, and none twice") {
  for (const bool quick : {true, false}) {
    for (const Chapter& chapter : ReportPlan(quick)) {
      CAPTURE(quick, chapter.name);
      CHECK(chapter.rows.size() > 0);
      std::vector<std::string> inputs;
      for (std::size_t i = 0; i < chapter.rows.size(); ++i) {
        std::string row;
        for (const std::string& column : chapter.rows.columns()) {
          row += chapter.rows.row(i).Find(column).value_or("") + ",";
        }
        inputs.push_back(row);
      }
      std::sort(inputs.begin(), inputs.end());
      CHECK(std::adjacent_find(inputs.begin(), inputs.end()) == inputs.end());
    }
  }
}

}  // namespace rikiseki::lab
