// SPDX-License-Identifier: MIT
// haptic_lab: experiments in virtual time with the very step functions that the daemons ship.
#include <algorithm>
#include <charconv>
#include <fstream>
#include <iostream>
#include <thread>

#include "common/command_line.h"
#include "common/daemon.h"
#include "common/exit_code.h"
#include "tests/lab/buzz.h"
#include "tests/lab/engine_error.h"
#include "tests/lab/error_vs_runtime.h"
#include "tests/lab/extremes.h"
#include "tests/lab/fig6.h"
#include "tests/lab/gallery.h"
#include "tests/lab/multirate.h"
#include "tests/lab/planes.h"
#include "tests/lab/push_traces.h"
#include "tests/lab/pushes.h"
#include "tests/lab/report/report.h"
#include "tests/lab/scene_cost.h"
#include "tests/lab/slides.h"
#include "tests/lab/soft_press.h"
#include "tests/lab/study.h"
#include "tests/lab/subjects.h"
#include "tests/lab/tensions.h"
#include "tests/lab/wall.h"

namespace rikiseki::lab {
namespace {
namespace po = boost::program_options;

// No cases: all of them and a page about them, and the page of an experiment with people.
constexpr const char* kReport = "report";
constexpr const char* kPeople = "people";

std::vector<Case> Cases() {
  return {Buzz(),      EngineError(), ErrorVsRuntime(),  Extremes(),        Fig6(),   PushTraces(),
          Subjects(),  Gallery(),     MultirateMasses(), MultirateGrowth(), Planes(), Pushes(),
          SceneCost(), Slides(),      SoftPresses(),     Tensions(),        Wall()};
}

struct Options {
  std::string case_name;
  std::string cases;  // the table to read; empty = the built-in grid
  std::string out;
  bool quick = false;
  StudyOptions study;
};

std::string CaseNames() {
  std::string names;
  std::string last;
  for (const Case& known : Cases()) {
    if (known.name != last) names += (names.empty() ? "" : ", ") + known.name;
    last = known.name;
  }
  return names;
}

void PrintHelp(const po::options_description& description) {
  std::cout << "haptic_lab CASE [options]\n"
            << "Runs both loops in virtual time, row by row of a table.\n\nCases:\n";
  for (const Case& known : Cases())
    std::cout << "  " << known.name << "  " << known.purpose << "\n";
  std::cout
      << "  " << kReport
      << "  runs what the report needs into the folder --out, goes on where it was stopped, and "
         "writes its page\n  "
      << kPeople << "  writes the page of scripts/experiment in the folder --out\n\n"
      << description
      << "\nExit status: 0; 1 if an expected result or a bar was missed; 64 for a wrong "
      << "command line; 78 for a\nwrong table.\n";
}

// "K/N" with 1 <= K <= N.
void ParseShard(const std::string& text, StudyOptions& options) {
  const char* end = text.data() + text.size();
  const auto shard = std::from_chars(text.data(), end, options.shard);
  const bool slash = shard.ec == std::errc() && shard.ptr != end && *shard.ptr == '/';
  const auto shards = slash ? std::from_chars(shard.ptr + 1, end, options.shards) : shard;
  if (!slash || shards.ec != std::errc() || shards.ptr != end || options.shard < 1 ||
      options.shard > options.shards) {
    throw StartError(kExitUsage, "--shard " + text + ": K/N with 1 <= K <= N is expected");
  }
}

Options Parse(int argc, char** argv) {
  Options options;
  options.study.jobs = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
  std::string shard = "1/1";
  CommandLine line{.program = "haptic_lab", .visible = po::options_description("Options")};
  line.visible.add_options()("cases", po::value(&options.cases)->value_name("F.csv"),
                             "rows to run; without it, the case's own grid")(
      "out", po::value(&options.out)->value_name("F.csv"),
      "where the rows go, with got_... columns appended; without it, rows of --cases go to stdout")(
      "quick", po::bool_switch(&options.quick), "makes the case's own grid smaller")(
      "jobs", po::value(&options.study.jobs)->value_name("N"), "threads (default: one per core)")(
      "shard", po::value(&shard)->value_name("K/N"), "only every N-th row, from the K-th on")(
      "seed", po::value(&options.study.seed)->value_name("S"), "of what a case draws at random");
  line.hidden.add_options()("case", po::value(&options.case_name));
  line.positional.add("case", 1);
  line.print_help = [&line] { PrintHelp(line.visible); };
  ParseCommandLine(argc, argv, line);
  if (options.study.jobs < 1 || options.study.jobs > 1024) {
    throw StartError(kExitUsage, "--jobs: 1 to 1024 is expected");
  }
  ParseShard(shard, options.study);
  return options;
}

int RunReport(const Options& options) {
  if (!options.cases.empty()) {
    throw StartError(kExitUsage,
                     "--cases: the report has its own rows; --out DIR is where they go");
  }
  const RunnerOptions runner{.folder = options.out.empty() ? "report" : options.out,
                             .size = options.quick ? "quick" : "full",
                             .jobs = options.study.jobs,
                             .shard = options.study.shard,
                             .shards = options.study.shards,
                             .seed = options.study.seed};
  return MakeReport(ReportPlan(options.quick), runner, std::cout) == 0 ? kExitOk : kExitFault;
}

int Run(int argc, char** argv) {
  const Options options = Parse(argc, argv);
  if (options.case_name == kReport) return RunReport(options);
  if (options.case_name == kPeople) {
    MakePeoplePage(options.out.empty() ? "." : options.out, std::cout);
    return kExitOk;
  }
  const std::vector<Case> cases = Cases();
  const auto named = [&](const Case& known) { return known.name == options.case_name; };
  auto study = std::find_if(cases.begin(), cases.end(), named);
  if (study == cases.end()) {
    const std::string complaint =
        options.case_name.empty() ? "a case is required" : "there is no case " + options.case_name;
    throw StartError(kExitUsage, complaint + "; those that exist: " + CaseNames());
  }
  const Table table =
      options.cases.empty() ? study->grid(options.quick) : Table::Load(options.cases);
  study = std::find_if(study, cases.end(), [&](const Case& known) {
    return named(known) && (!known.takes || known.takes(table));
  });
  if (study == cases.end()) {
    throw ConfigError(table.name() + ": the columns are of no row format of " + options.case_name);
  }
  // Tried before the work, which may be long; what the file holds is kept until there is something
  // new.
  if (!options.out.empty() && !std::ofstream(options.out, std::ios::app)) {
    throw StartError(kExitFault, options.out + ": cannot be written");
  }

  const StudyResult result = RunStudy(*study, table, options.study);
  const bool rows_to_stdout = options.out.empty() && !options.cases.empty();
  if (rows_to_stdout) WriteStudy(*study, result, std::cout);
  if (!options.out.empty()) {
    std::ofstream file(options.out, std::ios::binary);
    WriteStudy(*study, result, file);
    file.close();
    if (!file) throw StartError(kExitFault, options.out + ": writing failed");
  }
  std::ostream& report = rows_to_stdout ? std::cerr : std::cout;
  study->summarise(result.rows, result.outcomes, report);
  report << result.rows.size() << " rows:";
  for (const RowStatus status :
       {RowStatus::kOk, RowStatus::kMissed, RowStatus::kUnstable, RowStatus::kUnsupported}) {
    report << " " << result.Count(status) << " " << StatusName(status);
  }
  report << "\n";
  // Rows of a table answer for what they expect, those of the own grid for each other.
  const bool judged = options.cases.empty() && study->judge;
  const std::size_t bars_missed =
      judged ? study->judge(result.rows, result.outcomes, report) : std::size_t{0};
  return result.Count(RowStatus::kMissed) + bars_missed == 0 ? kExitOk : kExitFault;
}

}  // namespace
}  // namespace rikiseki::lab

int main(int argc, char** argv) {
  return rikiseki::RunProgram("haptic_lab", [=] { return rikiseki::lab::Run(argc, argv); });
}
