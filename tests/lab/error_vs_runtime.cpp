// SPDX-License-Identifier: MIT
#include "tests/lab/error_vs_runtime.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <ostream>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/lab/choose.h"
#include "tests/lab/coupling_column.h"
#include "tests/lab/error_run.h"

namespace rikiseki::lab {
namespace {

const std::vector<std::string> kColumns = {"system", "coupling",  "display",   "T_s",
                                           "Tw_s",   "body_step", "substep_s", "phases"};

const std::vector<ResultColumn> kResults = {
    {"split_rms_m"},      {"split_bias_m"},      {"split_sd_m"},      {"split_turn_rad"},
    {"continuous_rms_m"}, {"continuous_bias_m"}, {"continuous_sd_m"}, {"continuous_turn_rad"},
    {"impulse_rms_ns"},   {"force_rms_n"},       {"force_step_n"},    {"injected_j"},
    {"jump_m"},           {"bytes_per_s"},       {"cpu_s_per_s"},     {"haptic_p50_us"},
    {"haptic_p999_us"}};
enum Result : std::size_t { kSplitRms = 0, kContinuousRms = 4, kBytes = 13, kCpu = 14 };

constexpr Named<ErrorSystem> kSystems[] = {{"P", ErrorSystem::kPoke},
                                           {"H", ErrorSystem::kPush},
                                           {"offcentre", ErrorSystem::kOffCentre},
                                           {"corner", ErrorSystem::kCorner},
                                           {"stack", ErrorSystem::kStack}};
constexpr Named<haptic::DisplayRule> kDisplays[] = {
    {"interpolate", haptic::DisplayRule::kInterpolate},
    {"hold", haptic::DisplayRule::kHold},
    {"extrapolate", haptic::DisplayRule::kExtrapolate}};
constexpr Named<PositionRule> kBodySteps[] = {{"second_order", PositionRule::kSecondOrder},
                                              {"semi_implicit", PositionRule::kSemiImplicit}};

PushLoops ParseLoops(const Row& row) {
  PushLoops loops;
  loops.coupling = Choose(row, "coupling", kCouplings);
  if (row.Find("display")) loops.display = Choose(row, "display", kDisplays);
  if (row.Find("body_step")) loops.position_rule = Choose(row, "body_step", kBodySteps);
  loops.haptic_period_s = row.NumberOr("T_s", 1e-5, 0.1, loops.haptic_period_s);
  loops.world_period_s = row.Number("Tw_s", 1e-5, 10);
  loops.substep_s = row.NumberOr("substep_s", 1e-5, 0.1, loops.substep_s);
  const double ratio = loops.world_period_s / loops.haptic_period_s;
  if (std::abs(ratio - std::round(ratio)) > 1e-9 * ratio || std::round(ratio) < 1) {
    row.Refuse("Tw_s", "a whole number of haptic periods T_s is expected");
  }
  return loops;
}

double Quantile(std::vector<float>& values, double share) {
  if (values.empty()) return 0;
  const auto place = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + place, values.end());
  return values[static_cast<std::size_t>(place)];
}

// Of the phases, so that a moment in which the computer was busy does not count.
double MedianCpuPerSecond(const std::vector<RunRecord>& runs) {
  std::vector<float> cpu;
  for (const RunRecord& run : runs) cpu.push_back(static_cast<float>(run.cpu_s / run.duration_s));
  return Quantile(cpu, 0.5);
}

Outcome RunRow(const Row& row, std::uint64_t /*seed*/) {
  const ErrorSystem system = Choose(row, "system", kSystems);
  PushLoops loops = ParseLoops(row);
  const int phases = row.Find("phases") ? row.Integer("phases", 1, 10'000) : 20;
  const double ticks_per_period = std::round(loops.world_period_s / loops.haptic_period_s);
  std::vector<RunRecord> runs;
  double bytes_per_s = 0;
  try {
    for (int i = 0; i < phases; ++i) {
      loops.phase_ticks = static_cast<int>(std::lround(i * ticks_per_period / phases));
      runs.push_back(RunErrorSystem(system, loops, Measure::kCost));
    }
    const RunRecord counted = RunErrorSystem(system, loops, Measure::kBytes);
    bytes_per_s = counted.bytes / counted.duration_s;
  } catch (const std::invalid_argument& error) {
    row.Refuse("Tw_s", error.what());
  }

  const RunRecord& single = SingleRateRecord(system, loops.haptic_period_s);
  const RunRecord& continuous = SingleRateRecord(system, kContinuousPeriod);
  const PlaceError split = CompareBodies(runs, single);
  const PlaceError all = CompareBodies(runs, continuous);
  double impulse_squares = 0, force_squares = 0, step = 0, injected = 0, jump = 0;
  bool diverged = false;
  std::vector<float> haptic_us;
  for (const RunRecord& run : runs) {
    impulse_squares += (run.impulse_ns - single.impulse_ns).squaredNorm() / phases;
    force_squares += std::pow(ForceTraceError(run, single), 2) / phases;
    step = std::max(step, run.largest_force_step_n);
    injected = std::max(injected, run.injected_j);
    jump = std::max(jump, run.jump_m);
    diverged = diverged || run.diverged;
    haptic_us.insert(haptic_us.end(), run.haptic_us.begin(), run.haptic_us.end());
  }
  return {diverged ? RowStatus::kUnstable : RowStatus::kOk,
          {split.rms_m, split.bias_m, split.sd_m, split.turn_rad, all.rms_m, all.bias_m, all.sd_m,
           all.turn_rad, std::sqrt(impulse_squares), std::sqrt(force_squares), step, injected, jump,
           bytes_per_s, MedianCpuPerSecond(runs), Quantile(haptic_us, 0.5),
           Quantile(haptic_us, 0.999)}};
}

struct Method {
  const char* coupling;
  const char* display;  // of `local`: none, its planes ride on the copies
};
const std::vector<Method> kMain = {
    {"position", "interpolate"}, {"impulse", "interpolate"}, {"impulse", "hold"}, {"local", ""}};

Table Grid(bool quick) {
  Table table("the grid of error-vs-runtime", kColumns);
  const std::string phases = quick ? "5" : "20";
  for (const auto& system : kSystems) {
    const bool has_engine =
        system.value != ErrorSystem::kPoke && system.value != ErrorSystem::kPush;
    const auto append = [&](const Method& method, double period_s, double world_period_s,
                            const char* body_step = "second_order", double substep_s = 1e-3) {
      const bool local = std::string(method.coupling) == "local";
      table.Append({system.name, method.coupling, method.display, ToField(period_s),
                    ToField(world_period_s), local ? body_step : "",
                    has_engine ? ToField(substep_s) : "", phases});
    };
    if (quick) {
      for (const double world_period_s : {0.01, 0.02, 0.05, 0.1}) {
        for (const Method& method : kMain) append(method, 1e-3, world_period_s);
      }
      for (const double period_s : {4e-3, 2e-3, 5e-4, 2.5e-4}) {
        for (const Method& method : kMain) append(method, period_s, 0.1);
      }
      continue;
    }
    for (const double period_s : {4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4, 1.25e-4}) {
      for (const double world_period_s : {0.005, 0.01, 0.02, 0.05, 0.1, 0.2}) {
        const double ratio = world_period_s / period_s;
        if (std::abs(ratio - std::round(ratio)) > 1e-9) continue;  // a row says so, too
        for (const Method& method : kMain) append(method, period_s, world_period_s);
        append({"impulse", "extrapolate"}, period_s, world_period_s);
        append({"position", "hold"}, period_s, world_period_s);
        append({"local", ""}, period_s, world_period_s, "semi_implicit");
      }
    }
    // The engine's substep.
    if (!has_engine) continue;
    for (const double substep_s : {2.5e-4, 5e-4, 2e-3, 5e-3, 1e-2}) {
      for (const Method& method : kMain) append(method, 1e-3, 0.05, "second_order", substep_s);
    }
  }
  return table;
}

void Summarise(const Table& rows, const std::vector<Outcome>& outcomes, std::ostream& out) {
  out << "RMS error of the final place [mm] against a single rate and against 20 us, and what it "
         "cost\n"
      << std::left << std::setw(11) << "system" << std::setw(10) << "coupling" << std::setw(13)
      << "display" << std::setw(9) << "T [s]" << std::setw(8) << "Tw [s]" << std::setw(15)
      << "body step" << std::setw(10) << "substep" << std::right << std::setw(12) << "split"
      << std::setw(12) << "continuous" << std::setw(12) << "CPU s/s" << std::setw(10) << "bytes/s"
      << "\n";
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const std::vector<double>& got = outcomes[i].values;
    if (got.size() != kResults.size()) continue;
    const auto text = [&](std::size_t column) {
      return rows.row(i).Find(kColumns[column]).value_or("-");
    };
    out << std::left << std::setw(11) << text(0) << std::setw(10) << text(1) << std::setw(13)
        << text(2) << std::setw(9) << text(3) << std::setw(8) << text(4) << std::setw(15) << text(5)
        << std::setw(10) << text(6) << std::right << std::fixed << std::setprecision(4);
    if (outcomes[i].status == RowStatus::kUnstable) {
      out << std::setw(24) << "diverged";
    } else {
      out << std::setw(12) << got[kSplitRms] * 1e3 << std::setw(12) << got[kContinuousRms] * 1e3;
    }
    out << std::setprecision(5) << std::setw(12) << got[kCpu] << std::setprecision(0)
        << std::setw(10) << got[kBytes] << std::defaultfloat << "\n";
  }
}

}  // namespace

Case ErrorVsRuntime() {
  Case study;
  study.name = "error-vs-runtime";
  study.purpose =
      "error of five pushes against CPU and bytes, over couplings, rates and rules (CPU: --jobs 1)";
  study.results = kResults;
  study.grid = Grid;
  study.run = RunRow;
  study.summarise = Summarise;
  return study;
}

}  // namespace rikiseki::lab
