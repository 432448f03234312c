// SPDX-License-Identifier: MIT
#include "tests/lab/pushes.h"

#include <cmath>
#include <stdexcept>

#include "tests/lab/push_rows.h"
#include "tests/lab/pushes_report.h"

namespace rikiseki::lab {
namespace {

Outcome RunRow(const Row& row, std::uint64_t /*seed*/) {
  const CubePush push = ParsePush(row);
  const PushLoops loops = ParseLoops(row);
  const int phases = row.Find("phases") ? row.Integer("phases", 1, 10'000) : kPushPhases;
  PushStatistics got;
  try {
    got = SimulateCubePushes(push, loops, phases);
  } catch (const std::invalid_argument& error) {
    row.Refuse("coupling", error.what());
  }
  return {got.diverged ? RowStatus::kUnstable : RowStatus::kOk,
          {got.displacement_mean_m, got.displacement_sd_m, got.displacement_min_m,
           got.displacement_max_m, got.force_mean_n, got.force_sd_n, got.force_peak_n,
           got.jump_max_m, got.yaw_rad}};
}

// An expected result is to be met as near as `local` must come to a single rate, whoever computed it.
double Tolerance(const Row& row, std::size_t result, double expected) {
  const PushLoops loops = ParseLoops(row);
  const PushBars bars = BarsOf(ParsePush(row).script, loops.coupling ? loops.world_period_s : 0);
  const auto other = [&](PushColumn column) {
    return std::abs(row.NumberOr(kPushResults[column], -1e9, 1e9, 0));
  };
  switch (result) {
    case kDisplacementMean:
      return bars.displacement * std::abs(expected) + bars.displacement_floor_m;
    case kDisplacementMin:
    case kDisplacementMax:  // of 20 phases, mostly within three SDs
      return (bars.displacement + 3 * bars.sd) * std::abs(expected) + bars.displacement_floor_m;
    case kDisplacementSd:
      return bars.sd * other(kDisplacementMean) + bars.displacement_floor_m;
    case kForceMean:
      return bars.force * std::abs(expected);
    case kForceSd:
      return bars.force * other(kForceMean);
    case kForcePeak:
      return bars.peak * std::abs(expected);
    case kJumpMax:
      return bars.jump_m;
    default:
      return bars.yaw_rad;
  }
}

bool Agrees(const Row& row, const Outcome& outcome, std::size_t result) {
  const double expected = ExpectedNumber(row, kPushResults[result]);
  const double got = outcome.values[result];
  if (!std::isfinite(expected)) return !std::isfinite(got);
  return std::abs(got - expected) <=
         Tolerance(row, result, expected) + RoundingOf(row.Text(kPushResults[result]));
}

struct Setup {
  const char* script;
  std::vector<double> masses_kg;
  double damping_ns_per_m = 0;
  std::vector<double> offsets_m = {0};
  std::vector<double> gaps_m = {0};
  std::vector<double> neighbours_kg = {0};
  std::vector<double> stiffnesses_n_per_m = {2000};
};

const std::vector<Setup> kSetups = {
    {.script = "push", .masses_kg = {1, 0.5, 0.1, 0.02, 0.005}},
    {.script = "poke", .masses_kg = {1, 0.5, 0.1}},
    {.script = "hold", .masses_kg = {0.5}, .damping_ns_per_m = 2},
    {.script = "press", .masses_kg = {0.005}, .stiffnesses_n_per_m = {2000, 10'000}},
    {.script = "offcentre", .masses_kg = {1, 0.5, 0.1}, .offsets_m = {0.01, 0.02}},
    {.script = "wall", .masses_kg = {0.5, 0.1}, .gaps_m = {0.02}},
    {.script = "neighbour",
     .masses_kg = {0.5, 0.1},
     .gaps_m = {0.01},
     .neighbours_kg = {5, 0.5, 0.05}},
    {.script = "stick", .masses_kg = {1, 0.5}},
};

const std::vector<Setup> kQuickSetups = {
    {.script = "push", .masses_kg = {0.5}},
    {.script = "press", .masses_kg = {0.005}},
};

void AppendLoops(Table& table, const std::vector<std::string>& push, bool quick) {
  const auto append = [&](const char* coupling, double world_period_s, long latency_ticks) {
    std::vector<std::string> row = push;
    const auto phases = quick ? 5 : kPushPhases;
    row.insert(row.end(), {coupling, ToField(world_period_s), std::to_string(latency_ticks),
                           std::to_string(phases)});
    table.Append(row);
  };
  append(kSingleRate, 1e-3, 0);
  const std::vector<double> periods_s =
      quick ? std::vector{0.05} : std::vector{0.02, 0.05, 0.1, 0.2};
  for (const double period_s : periods_s) {
    const long ticks = std::lround(period_s / 1e-3);
    append("position", period_s, 0);
    append("impulse", period_s, 0);
    for (const long latency : {0L, ticks / 2, ticks}) append("local", period_s, latency);
  }
}

Table Grid(bool quick) {
  std::vector<std::string> columns = kPushColumns;
  columns.insert(columns.end(), kLoopColumns.begin(), kLoopColumns.end());
  Table table("the grid of pushes", columns);
  for (const Setup& setup : quick ? kQuickSetups : kSetups) {
    for (const double stiffness : setup.stiffnesses_n_per_m) {
      for (const double offset_m : setup.offsets_m) {
        for (const double gap_m : setup.gaps_m) {
          for (const double neighbour_kg : setup.neighbours_kg) {
            for (const double mass_kg : setup.masses_kg) {
              AppendLoops(
                  table,
                  {setup.script, ToField(mass_kg), "0.3", ToField(stiffness),
                   ToField(setup.damping_ns_per_m), ToField(offset_m),
                   gap_m > 0 ? ToField(gap_m) : "", neighbour_kg > 0 ? ToField(neighbour_kg) : ""},
                  quick);
            }
          }
        }
      }
    }
  }
  return table;
}

}  // namespace

Case Pushes() {
  Case study;
  study.name = "pushes";
  study.purpose =
      "a prescribed finger pushes a cube on a floor: displacement and force over the sampling "
      "phases (nothing random)";
  for (const char* name : kPushResults) study.results.push_back({name});
  study.grid = Grid;
  study.run = RunRow;
  study.agrees = Agrees;
  study.summarise = SummarisePushes;
  study.judge = JudgePushes;
  return study;
}

}  // namespace rikiseki::lab
