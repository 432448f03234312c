// SPDX-License-Identifier: MIT
#include "tests/lab/extremes.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <ostream>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/lab/choose.h"
#include "tests/lab/coupling_column.h"
#include "tests/lab/extreme_run.h"
#include "tests/lab/hand_column.h"
#include "tests/lab/multirate_loop.h"

namespace rikiseki::lab {
namespace {

// numerics section 6: what grows faster than this per world period is unstable, what stays below the
// other is stable, and between them nobody is asked.
constexpr double kUnstableGrowth = 1.02;
constexpr double kStableGrowth = 0.98;

constexpr double kRounding = 1e-9;         // of what a limit may be passed by
constexpr double kShortest = 10;           // s
constexpr double kPeriodsForGrowth = 600;  // 1.02^600 = 1e5: what grows has shown it by then

const std::vector<std::string> kColumns = {
    "event", "coupling", "haptic_hz", "world_hz",      "kp",
    "kd",    "M",        "hand",      "latency_ticks", "duration_s"};

enum Result : std::size_t {
  kFinite,
  kCapOk,
  kSlewOk,
  kFlagged,
  kGrowth,
  kUnstable,
  kFlagOk,
  kLargestForce,
  kLargestStep,
};
const std::vector<ResultColumn> kResults = {{"finite"},
                                            {"cap_ok"},
                                            {"slew_ok"},
                                            {"flagged"},
                                            {"growth", 0.01},
                                            {"unstable"},
                                            {"flag_ok"},
                                            {"largest_force_n", 1e-6},
                                            {"largest_step_n", 1e-6}};

constexpr Named<ExtremeEvent> kEvents[] = {
    {"slot", ExtremeEvent::kSlot},         {"fast", ExtremeEvent::kFast},
    {"far", ExtremeEvent::kFar},           {"nan", ExtremeEvent::kNotFinite},
    {"denormal", ExtremeEvent::kDenormal}, {"silent", ExtremeEvent::kSilence},
};
ExtremeRun ParseRun(const Row& row) {
  ExtremeRun run;
  run.event = Choose(row, "event", kEvents);
  run.coupling = Choose(row, "coupling", kCouplings);
  run.haptic_hz = row.Number("haptic_hz", 100, 8000);
  run.world_hz = row.Number("world_hz", 1, 8000);
  run.stiffness_n_per_m = row.Number("kp", 1, 1e6);
  run.damping_ns_per_m = row.NumberOr("kd", 0, 1e4, 0);
  run.mass_kg = row.Number("M", 1e-5, 1e5);
  if (run.event == ExtremeEvent::kSlot) run.hand = ParseHand(row);
  if (row.Find("latency_ticks")) run.latency_ticks = row.Integer("latency_ticks", 0, 100'000);
  run.duration_s = row.NumberOr("duration_s", 0.1, 1e5, kShortest);
  return run;
}

bool IsStiff(const ExtremeRun& run) {
  const double period_s = 1 / run.haptic_hz;
  return period_s * (run.stiffness_n_per_m * period_s + 2 * run.damping_ns_per_m) >= run.mass_kg;
}

LoopMethod MethodOf(const ExtremeRun& run) {
  switch (run.coupling) {
    case protocol::Coupling::kPosition:
      return LoopMethod::kPosition;
    case protocol::Coupling::kImpulse:
      return LoopMethod::kInterpolate;
    default:
      return IsStiff(run) ? LoopMethod::kLocalImplicit : LoopMethod::kLocalReplay;
  }
}

// The truth about a finger in a slot, from the linear loop; nothing where the rates are no multiples
// of each other.
std::optional<double> GrowthPerPeriod(const ExtremeRun& run) {
  const double ratio = run.haptic_hz / run.world_hz;
  const double ticks = std::round(ratio);
  if (run.event != ExtremeEvent::kSlot || ticks < 1 || std::abs(ratio - ticks) > 1e-9 * ratio) {
    return std::nullopt;
  }
  const PeriodMap map({.method = MethodOf(run),
                       .hand = run.hand,
                       .stiffness_n_per_m = run.stiffness_n_per_m,
                       .damping_ns_per_m = run.damping_ns_per_m,
                       .period_s = 1 / run.haptic_hz,
                       .ticks_per_period = static_cast<int>(ticks),
                       .latency_ticks = run.latency_ticks});
  return map.SpectralRadius(run.mass_kg);
}

// The truth: 1 unstable, 0 stable, nan = nobody knows. Where the linear loop calls a contact stable
// that grew from half a newton to the cap, the run is right: the loop has one spring that pushes and
// pulls, the slot two that push.
double IsUnstable(const ExtremeResult& got, const std::optional<double>& growth) {
  if (growth && *growth > kUnstableGrowth) return 1;
  if (growth && *growth < kStableGrowth) {
    return got.largest_force_n >= got.force_cap_n * (1 - kRounding) ? 1 : 0;
  }
  return std::numeric_limits<double>::quiet_NaN();
}

Outcome RunRow(const Row& row, std::uint64_t /*seed*/) {
  const ExtremeRun run = ParseRun(row);
  try {
    const ExtremeResult got = SimulateExtreme(run);
    const std::optional<double> growth = GrowthPerPeriod(run);
    const double unstable = IsUnstable(got, growth);
    return {RowStatus::kOk,
            {static_cast<double>(got.sound && got.force_finite),
             static_cast<double>(got.largest_force_n <= got.force_cap_n),
             static_cast<double>(got.largest_step_n <= got.step_limit_n * (1 + kRounding)),
             static_cast<double>(got.flagged),
             growth.value_or(std::numeric_limits<double>::quiet_NaN()), unstable,
             static_cast<double>(std::isnan(unstable) || (unstable == 1) == got.flagged),
             got.largest_force_n, got.largest_step_n}};
  } catch (const std::invalid_argument& error) {
    row.Refuse("world_hz", error.what());
  }
}

struct Rates {
  double haptic_hz;
  double world_hz;
};

void AppendRow(Table& table, const char* event, const char* coupling, const Rates& rates,
               double stiffness, double mass_kg, const char* hand) {
  const bool slot = std::string(event) == "slot";
  const double duration_s =
      slot ? std::max(kShortest, kPeriodsForGrowth / rates.world_hz) : kShortest;
  table.Append({event, coupling, ToField(rates.haptic_hz), ToField(rates.world_hz),
                ToField(stiffness), "2", ToField(mass_kg), slot ? hand : "", "0",
                ToField(duration_s)});
}

Table Grid(bool quick) {
  Table table("the grid of extremes", kColumns);
  const std::vector<double> stiffnesses = quick ? std::vector{2000.0} : std::vector{10.0, 2e3, 1e5};
  const std::vector<double> masses =
      quick ? std::vector{0.01, 1.0} : std::vector{1e-4, 1e-2, 1.0, 100.0, 1e4};
  const std::vector<Rates> rates =
      quick ? std::vector<Rates>{{1000, 20}}
            : std::vector<Rates>{{1000, 20},  {1000, 200}, {1000, 1},  {100, 20},  {100, 1},
                                 {8000, 200}, {8000, 20},  {200, 200}, {100, 200}, {1000, 30}};
  for (const auto& coupling : kCouplings) {
    for (const Rates& pair : rates) {
      for (const double stiffness : stiffnesses) {
        for (const double mass_kg : masses) {
          AppendRow(table, "slot", coupling.name, pair, stiffness, mass_kg, "medium");
        }
      }
    }
    for (const auto& event : kEvents) {
      if (event.value == ExtremeEvent::kSlot) continue;
      const std::vector<Rates> event_rates =
          quick ? std::vector<Rates>{{1000, 20}}
                : std::vector<Rates>{{1000, 20}, {100, 200}, {8000, 1}, {1000, 30}};
      for (const Rates& pair : event_rates) {
        for (const double stiffness : stiffnesses) {
          for (const double mass_kg : masses) {
            AppendRow(table, event.name, coupling.name, pair, stiffness, mass_kg, "");
          }
        }
      }
    }
  }
  return table;
}

void Summarise(const Table& rows, const std::vector<Outcome>& outcomes, std::ostream& out) {
  std::size_t unsafe = 0, unstable = 0, unseen = 0, stable = 0, accused = 0, between = 0;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const std::vector<double>& got = outcomes[i].values;
    if (got.size() != kResults.size()) continue;
    if (got[kFinite] != 1 || got[kCapOk] != 1 || got[kSlewOk] != 1) ++unsafe;
    if (std::isnan(got[kGrowth])) continue;
    if (std::isnan(got[kUnstable])) {
      ++between;
    } else if (got[kUnstable] == 1) {
      ++unstable;
      if (got[kFlagged] != 1) ++unseen;
    } else {
      ++stable;
      if (got[kFlagged] != 0) ++accused;
    }
  }
  out << "unsafe: " << unsafe << " of " << rows.size() << "\n"
      << "unstable contacts: " << unstable << ", of which not flagged: " << unseen << "\n"
      << "stable contacts: " << stable << ", of which flagged: " << accused << "\n"
      << "between, not scored: " << between << "\n";
}

std::size_t Judge(const Table& rows, const std::vector<Outcome>& outcomes, std::ostream& out) {
  std::size_t missed = 0;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const std::vector<double>& got = outcomes[i].values;
    for (const Result bar : {kFinite, kCapOk, kSlewOk, kFlagOk}) {
      if (got[bar] == 1) continue;
      ++missed;
      out << "missed: " << kResults[bar].name << ":";
      for (const std::string& column : kColumns) {
        out << " " << column << " " << rows.row(i).Find(column).value_or("-");
      }
      out << ", growth " << got[kGrowth] << "\n";
    }
  }
  return missed;
}

}  // namespace

Case Extremes() {
  Case study;
  study.name = "extremes";
  study.purpose =
      "absurd masses, stiffnesses, rates, fingers, samples and silences: nothing unsound leaves, "
      "limits hold, what is unstable is flagged (nothing random)";
  study.results = kResults;
  study.grid = Grid;
  study.run = RunRow;
  study.summarise = Summarise;
  study.judge = Judge;
  return study;
}

}  // namespace rikiseki::lab
