// SPDX-License-Identifier: MIT
#include "tests/lab/slides.h"

#include <array>
#include <cmath>
#include <iomanip>
#include <map>
#include <ostream>
#include <sstream>
#include <stdexcept>

#include "tests/lab/slide_run.h"

namespace rikiseki::lab {
namespace {

constexpr int kPhases = 10;  // where a row does not say

// No step above the slew limit; the books to the last digit; the energy as far as doubles and the
// rounding of impulses to units carry.
constexpr double kLargestStepRatio = 1;
constexpr double kLargestBooksError = 1e-12;
constexpr double kLargestEnergyError = 1e-9;

enum SlideColumn : std::size_t {
  kStepRatio,
  kForceErrorRms,
  kForceErrorPeak,
  kSingleRms,
  kBooksError,
  kEnergyError,
};
const std::array<const char*, kEnergyError + 1> kSlideResults = {
    "step_ratio",   "force_error_rms_n", "force_error_peak_n",
    "single_rms_n", "books_error",       "energy_error"};

const std::map<std::string, SlideScript> kScripts = {{"sphere", SlideScript::kSphere},
                                                     {"edge", SlideScript::kEdge},
                                                     {"round", SlideScript::kRound},
                                                     {"free", SlideScript::kFree}};
const std::map<std::string, protocol::Coupling> kCouplings = {
    {"position", protocol::Coupling::kPosition},
    {"impulse", protocol::Coupling::kImpulse},
    {"local", protocol::Coupling::kLocal}};

template <typename Value>
Value Choose(const Row& row, const char* column, const std::map<std::string, Value>& entries) {
  const auto found = entries.find(row.Text(column));
  if (found != entries.end()) return found->second;
  std::string names;
  for (const auto& [name, value] : entries) names += (names.empty() ? "" : ", ") + name;
  row.Refuse(column, "one of " + names + " is expected");
}

Outcome RunRow(const Row& row, std::uint64_t /*seed*/) {
  Slide slide;
  slide.script = Choose(row, "script", kScripts);
  slide.friction = row.NumberOr("mu", 0, 10, slide.friction);
  slide.depth_m = row.NumberOr("depth_m", 1e-6, kSlideRadius / 2, slide.depth_m);
  SlideLoops loops;
  loops.coupling = Choose(row, "coupling", kCouplings);
  loops.world_period_s = row.Number("Tw_s", 1e-3, 10);
  if (row.Find("latency_ticks")) loops.latency_ticks = row.Integer("latency_ticks", 0, 100'000);
  loops.stiffness_n_per_m = row.NumberOr("kp", 1, 1e6, loops.stiffness_n_per_m);
  loops.damping_ns_per_m = row.NumberOr("kd", 0, 1e4, loops.damping_ns_per_m);
  loops.motion_scale = row.NumberOr("motion_scale", 1e-3, 1e3, 1);
  loops.force_scale = row.NumberOr("force_scale", 1e-3, 1e3, 1);
  const int phases = row.Find("phases") ? row.Integer("phases", 1, 10'000) : kPhases;
  SlideComparison got;
  try {
    got = CompareSlides(slide, loops, phases);
  } catch (const std::invalid_argument& error) {
    row.Refuse("coupling", error.what());
  }
  // A free block at a slow world's rate is unstable with the other couplings, whatever slides.
  const bool is_calm =
      slide.script != SlideScript::kFree || loops.coupling == protocol::Coupling::kLocal;
  const bool kept = got.sound && (!is_calm || got.step_ratio <= kLargestStepRatio) &&
                    got.books_error <= kLargestBooksError &&
                    got.energy_error <= kLargestEnergyError;
  return {kept ? RowStatus::kOk : RowStatus::kMissed,
          {got.step_ratio, got.force_error_rms_n, got.force_error_peak_n, got.single_rms_n,
           got.books_error, got.energy_error}};
}

// Computed once and for all: an expected result is met where it is the same run.
bool Agrees(const Row& row, const Outcome& outcome, std::size_t result) {
  const double expected = ExpectedNumber(row, kSlideResults[result]);
  const double got = outcome.values[result];
  if (!std::isfinite(expected)) return !std::isfinite(got);
  const bool is_bar = result == kBooksError || result == kEnergyError;
  const double tolerance = is_bar ? kLargestEnergyError : 1e-3 * std::abs(expected) + 1e-6;
  return std::abs(got - expected) <= tolerance;
}

struct Scales {
  double motion, force;
};

Table Grid(bool quick) {
  Table table("the grid of slides",
              {"script", "mu", "coupling", "Tw_s", "motion_scale", "force_scale", "phases"});
  const std::vector<double> rates_hz =
      quick ? std::vector<double>{20, 5} : std::vector<double>{60, 50, 20, 10, 5};
  const std::vector<Scales> mappings = {{1, 1}, {5, 0.2}};
  for (const char* script : {"sphere", "edge", "round", "free"}) {
    for (const double mu : {0.0, 0.3}) {
      if (std::string(script) == "free" && mu > 0) continue;  // it is pushed, not slid over
      for (const Scales& scales : mappings) {
        for (const char* coupling : {"position", "impulse", "local"}) {
          for (const double rate_hz : rates_hz) {
            table.Append({script, ToField(mu), coupling, ToField(1 / rate_hz),
                          ToField(scales.motion), ToField(scales.force), quick ? "2" : "10"});
          }
        }
      }
    }
  }
  return table;
}

// A line for each script, friction, mapping and coupling; a column for each world rate.
void Summarise(const Table& rows, const std::vector<Outcome>& outcomes, std::ostream& out) {
  std::map<std::string, std::map<double, std::string>> lines;
  std::vector<std::string> order;
  std::map<double, std::string> rates;
  double step = 0;
  double books = 0;
  double energy = 0;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Row row = rows.row(i);
    const std::vector<double>& got = outcomes[i].values;
    std::ostringstream label;
    label << row.Text("script") << ", mu " << row.Find("mu").value_or("0") << ", scales "
          << row.Find("motion_scale").value_or("1") << " " << row.Find("force_scale").value_or("1")
          << ", " << row.Text("coupling");
    if (lines.find(label.str()) == lines.end()) order.push_back(label.str());
    std::ostringstream cell;
    cell << std::fixed << std::setprecision(3) << got[kForceErrorRms] << " / "
         << got[kForceErrorPeak];
    const double period_s = row.Number("Tw_s", 1e-3, 10);
    lines[label.str()][period_s] = cell.str();
    std::ostringstream rate;
    rate << std::setprecision(3) << 1 / period_s << " Hz";
    rates[period_s] = rate.str();
    step = std::max(step, got[kStepRatio]);
    books = std::max(books, got[kBooksError]);
    energy = std::max(energy, got[kEnergyError]);
  }
  constexpr int kLabel = 40;
  constexpr int kCell = 16;
  out << "force against the same slide at a single rate: RMS / largest error, N at the device\n"
      << std::setw(kLabel) << "";
  for (const auto& [period_s, name] : rates) out << std::setw(kCell) << name;
  out << "\n";
  for (const std::string& label : order) {
    out << std::left << std::setw(kLabel) << label << std::right;
    for (const auto& [period_s, name] : rates) out << std::setw(kCell) << lines[label][period_s];
    out << "\n";
  }
  out << "largest step of the force: " << step << " of what the slew limit allows; books off by "
      << books << ", energy by " << energy << " of what flowed\n";
}

}  // namespace

Case Slides() {
  Case study;
  study.name = "slides";
  study.purpose =
      "a finger slides over a fixed sphere and off the edge of a box: force, its steps, books and "
      "energy against a single rate (nothing random)";
  for (const char* name : kSlideResults) study.results.push_back({name});
  study.grid = Grid;
  study.run = RunRow;
  study.agrees = Agrees;
  study.summarise = Summarise;
  return study;
}

}  // namespace rikiseki::lab
