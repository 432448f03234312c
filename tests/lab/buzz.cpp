// SPDX-License-Identifier: MIT
#include "tests/lab/buzz.h"

#include <array>
#include <cmath>
#include <iomanip>
#include <ostream>
#include <sstream>
#include <stdexcept>

#include "tests/lab/buzz_run.h"

namespace rikiseki::lab {
namespace {

constexpr int kPhases = 10;     // where a row does not say
constexpr double kMass = 0.02;  // kg, likewise

enum BuzzColumn : std::size_t { kSingle, kMean, kWorst, kRatio, kWorstRatio, kPeak };
const std::array<const char*, kPeak + 1> kBuzzResults = {"single", "mean",        "worst",
                                                         "ratio",  "worst_ratio", "peak_n"};

const std::array<Touch, 4> kTouches = {kPushTouch, kPokeTouch, kPressTouch, kSlideTouch};

struct NamedCoupling {
  const char* name;
  protocol::Coupling coupling;
};
constexpr NamedCoupling kCouplings[] = {{"position", protocol::Coupling::kPosition},
                                        {"impulse", protocol::Coupling::kImpulse},
                                        {"local", protocol::Coupling::kLocal}};

const Touch& TouchOfRow(const Row& row) {
  const std::string name = row.Text("touch");
  for (const Touch& touch : kTouches) {
    if (name == touch.name) return touch;
  }
  row.Refuse("touch", "one of push, poke, press, slide is expected");
}

protocol::Coupling CouplingOf(const Row& row) {
  const std::string name = row.Text("coupling");
  for (const NamedCoupling& known : kCouplings) {
    if (name == known.name) return known.coupling;
  }
  row.Refuse("coupling", "one of position, impulse, local is expected");
}

BuzzRun ParseRun(const Row& row) {
  BuzzRun run;
  run.touch = TouchOfRow(row);
  run.mass_kg = row.NumberOr("mass_kg", 1e-6, 1e6, kMass);
  run.coupling = CouplingOf(row);
  run.world_period_s = row.Number("Tw_s", 1e-3, 10);
  if (row.Find("latency_ticks")) run.latency_ticks = row.Integer("latency_ticks", 0, 100'000);
  return run;
}

Outcome RunRow(const Row& row, std::uint64_t /*seed*/) {
  const BuzzRun run = ParseRun(row);
  const int phases = row.Find("phases") ? row.Integer("phases", 1, 10'000) : kPhases;
  BuzzComparison got;
  try {
    got = CompareBuzz(run, phases);
  } catch (const std::invalid_argument& error) {
    row.Refuse("coupling", error.what());
  }
  // At rest a block may be as restless as the encoder; a single rate may be perfectly still.
  const double beside = IsPress(run.touch) ? got.quiet_rms_n : got.single;
  return {RowStatus::kOk,
          {got.single, got.mean, got.worst, got.mean / beside, got.worst / beside, got.peak_n}};
}

bool Agrees(const Row& row, const Outcome& outcome, std::size_t result) {
  const double expected = ExpectedNumber(row, kBuzzResults[result]);
  const double got = outcome.values[result];
  if (!std::isfinite(expected)) return !std::isfinite(got);
  return std::abs(got - expected) <= 0.01 * std::abs(expected) + 1e-9;
}

Table Grid(bool quick) {
  Table table("the grid of buzz", {"touch", "coupling", "Tw_s", "latency_ticks", "phases"});
  for (const Touch& touch : kTouches) {
    for (const double rate_hz : {60.0, 20.0, 10.0}) {
      const long ticks = std::lround(1000 / rate_hz);
      const auto append = [&](const char* coupling, long latency_ticks) {
        table.Append({touch.name, coupling, ToField(1 / rate_hz), std::to_string(latency_ticks),
                      quick ? "2" : "10"});
      };
      append("local", 0);
      if (quick) continue;
      append("local", ticks / 2);
      append("local", ticks);
      append("impulse", 0);
      append("position", 0);
    }
  }
  return table;
}

std::string Label(const Row& row) {
  const BuzzRun run = ParseRun(row);
  std::ostringstream label;
  label << row.Text("touch") << ", " << row.Text("coupling") << ", " << std::setprecision(3)
        << 1 / run.world_period_s << " Hz, latency " << run.latency_ticks;
  return label.str();
}

void Summarise(const Table& rows, const std::vector<Outcome>& outcomes, std::ostream& out) {
  out << "above 30 Hz: N^2 s of the force of a touch, and N (RMS) of a press at rest; the ratio is "
         "to "
         "the same\ntouch at a single rate, of the press to 1.5 encoder counts times the "
         "stiffness\n"
      << std::left << std::setw(40) << "" << std::right << std::setw(14) << "single rate"
      << std::setw(14) << "mean" << std::setw(10) << "ratio" << std::setw(13) << "worst phase"
      << std::setw(10) << "peak N"
      << "\n";
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const std::vector<double>& got = outcomes[i].values;
    out << std::left << std::setw(40) << Label(rows.row(i)) << std::right << std::setprecision(4)
        << std::setw(14) << got[kSingle] << std::setw(14) << got[kMean] << std::setprecision(3)
        << std::fixed << std::setw(10) << got[kRatio] << std::setw(13) << got[kWorstRatio]
        << std::setw(10) << got[kPeak] << std::defaultfloat << "\n";
  }
}

// `local` must not buzz; of the others it is known.
std::size_t Judge(const Table& rows, const std::vector<Outcome>& outcomes, std::ostream& out) {
  std::size_t missed = 0;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Row row = rows.row(i);
    if (CouplingOf(row) != protocol::Coupling::kLocal) continue;
    const bool press = IsPress(TouchOfRow(row));
    const double got = outcomes[i].values[press ? kWorstRatio : kRatio];
    const double most = press ? 1 : kMostBuzz;
    if (got <= most) continue;
    ++missed;
    out << "missed: " << Label(row) << ": " << got << ", at most " << most << "\n";
  }
  return missed;
}

}  // namespace

Case Buzz() {
  Case study;
  study.name = "buzz";
  study.purpose =
      "a hand on the simulated SPIDAR touches a cube of 20 g: the force above 30 Hz against a "
      "single "
      "rate (nothing random)";
  for (const char* name : kBuzzResults) study.results.push_back({name});
  study.grid = Grid;
  study.run = RunRow;
  study.agrees = Agrees;
  study.summarise = Summarise;
  study.judge = Judge;
  return study;
}

}  // namespace rikiseki::lab
