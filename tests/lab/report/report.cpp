// SPDX-License-Identifier: MIT
#include "tests/lab/report/report.h"

#include <fstream>
#include <numeric>
#include <ostream>
#include <set>

#include "common/version.h"
#include "tests/lab/report/sections.h"
#include "tests/lab/subjects.h"

namespace rikiseki::lab {
namespace {

void WriteOrigin(const RunnerOptions& options, const Results& results, std::size_t missing,
                 Html& page) {
  const bool quick = options.size == "quick";
  page.Paragraph(
      "What the coupling of a haptic display and a slow world costs and gets wrong, computed in "
      "virtual "
      "time by the step functions that the daemons ship. Every figure can be repeated: a rerun "
      "gives "
      "the same numbers to the last digit, but for times. The rows of each stand as CSV beside "
      "this "
      "page.");
  page.Command(std::string("scripts/report") + (quick ? " --quick" : "") +
               (options.seed == 1 ? "" : " --seed " + std::to_string(options.seed)));
  std::set<std::string> machines;
  std::size_t rows = 0;
  for (const auto& [chapter, finished] : results) {
    rows += finished.size();
    for (const ResultRow& row : finished) machines.insert(row.machine);
  }
  std::vector<std::string> items = {"haptic_lab " + std::string(kVersion) + " (" + kBuild + "), " +
                                    std::to_string(rows) + " rows"};
  for (const std::string& machine : machines) items.push_back("run on " + machine);
  page.List(items);
  if (quick) {
    page.Paragraph("This is the quick report: fewer phases, rates, masses, scenes and subjects.");
  }
  if (missing > 0) {
    page.Warning(std::to_string(missing) +
                 " rows are missing: other shards were not run, or their files are not here.");
  }
}

// Rows that broke what holds for every row of their study.
std::size_t WriteBroken(const Results& results, Html& page) {
  std::size_t all = 0;
  for (const auto& [chapter, rows] : results) {
    if (chapter.starts_with("reference_")) continue;  // the last section has them
    const std::size_t broken = CountMissed(rows);
    if (broken > 0) {
      page.Warning(std::to_string(broken) + " of the " + std::to_string(rows.size()) + " rows of " +
                   chapter + " broke a bar that holds for every row.");
    }
    all += broken;
  }
  return all;
}

void WritePage(const Html& page, const std::string& title, const std::filesystem::path& folder,
               std::ostream& out) {
  const std::filesystem::path path = folder / "index.html";
  std::ofstream file(path, std::ios::binary);
  file << page.Page(title);
  file.close();
  if (!file) throw ConfigError(path.string() + ": cannot be written");
  out << path.string() << " is written";
}

}  // namespace

std::size_t MakeReport(const std::vector<Chapter>& chapters, const RunnerOptions& options,
                       std::ostream& out) {
  RunChapters(chapters, options, out);
  std::size_t missing = 0;
  const Results results = ReadResults(chapters, options.folder, missing);
  Html page;
  WriteOrigin(options, results, missing, page);
  const std::size_t broken = WriteBroken(results, page);
  WriteAnswers(results, page);
  WriteError(results, page);
  WriteStability(results, page);
  WriteScenes(results, page);
  WritePaper(results, page);
  const std::size_t missed = WriteReferences(chapters, results, page);
  WritePage(page, "Rikiseki: error, stability and cost", options.folder, out);
  if (missing > 0) {
    out << "; " << missing << " rows are missing: run the other shards, put their files into "
        << options.folder.string() << ", and run this again";
  }
  out << "\n";
  if (missed > 0) out << missed << " reference rows were missed\n";
  if (broken > 0) out << broken << " other rows broke a bar\n";
  return missed + broken;
}

void MakePeoplePage(const std::filesystem::path& folder, std::ostream& out) {
  const Table table = Table::Load(folder / "people.csv");
  std::vector<std::size_t> all(table.size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  std::vector<std::string> results;
  for (const std::string& column : table.columns()) {
    if (column.starts_with("got_")) results.push_back(column);
  }
  const std::vector<Chapter> chapters = {
      {.name = "people", .study = Subjects(), .rows = table.Select(all, results)}};
  std::size_t missing = 0;
  Html page;
  WritePeople(ReadResults(chapters, folder, missing), page);
  WritePage(page, "Rikiseki: the 30 cm task", folder, out);
  out << "\n";
}

}  // namespace rikiseki::lab
