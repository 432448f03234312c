// SPDX-License-Identifier: MIT
#include "tests/lab/multirate.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <iomanip>
#include <limits>
#include <map>
#include <ostream>
#include <sstream>
#include <string>
#include <vector>

#include "tests/lab/hand_column.h"
#include "tests/lab/stable_masses.h"

namespace rikiseki::lab {
namespace {

constexpr int kMostTicks = 100'000;  // per world period

void CheckLatency(const Row& row, const char* column, const MultirateLoop& loop) {
  if (loop.latency_ticks > kLongestLatency * loop.ticks_per_period) {
    row.Refuse(column, "at most 8 world periods are expected");
  }
}

// --- Stable masses ---

enum MassResult : std::size_t { kLeastStable, kIntervals };
constexpr double kScanStep = 1.26;  // 10^(1/10), rounded up
const char* const kMassColumn = "M_min_kg";
const char* const kIntervalColumn = "stable_intervals_kg_in_1e-5..1e4";

// Only `local` that is consistent has a limit known to 1 %: numerics section 6.
double MassTolerance(const std::string& method) {
  const bool consistent =
      method == "local_M1" || method == "local_AUTH" || method == "local_M1_implicit";
  return consistent ? 0.01 : 0.1;
}

std::string MassText(double mass) {
  std::array<char, 32> text{};
  const int length = std::snprintf(text.data(), text.size(), "%.5g", mass);
  return {text.data(), static_cast<std::size_t>(length)};
}

std::string ToText(const std::vector<StableInterval>& intervals) {
  std::string text;
  for (const StableInterval& interval : intervals) {
    if (!text.empty()) text += ";";
    text += MassText(interval.from) + "..";
    text += interval.to >= kGreatestMass ? std::string("inf") : MassText(interval.to);
  }
  return text;
}

// Nothing if the text is no list of intervals.
std::optional<std::vector<StableInterval>> ParseIntervals(const std::string& text) {
  std::vector<StableInterval> intervals;
  std::istringstream parts(text);
  for (std::string part; std::getline(parts, part, ';');) {
    const std::size_t dots = part.find("..");
    if (dots == std::string::npos) return std::nullopt;
    try {
      const double to = std::stod(part.substr(dots + 2));
      intervals.push_back({std::stod(part.substr(0, dots)), std::min(to, kGreatestMass)});
    } catch (const std::logic_error&) {  // std::stod throws two kinds
      return std::nullopt;
    }
  }
  return intervals;
}

bool Near(double a, double b, double tolerance) {
  return std::abs(std::log(a / b)) <= std::log1p(tolerance) + 1e-4;  // five digits are written
}

// The ends of intervals in rising order, but for those of the whole range.
std::vector<double> EdgesOf(const std::vector<StableInterval>& intervals) {
  std::vector<double> edges;
  for (const StableInterval& interval : intervals) {
    if (interval.from > kLeastMass * 1.001) edges.push_back(interval.from);
    if (interval.to < kGreatestMass * 0.999) edges.push_back(interval.to);
  }
  return edges;
}

// Tables are made by scans of ten masses per decade, so they may lack gaps and intervals narrower
// than that; and what is narrower than the tolerance cannot be asked for.
bool Same(const std::vector<StableInterval>& got, std::vector<StableInterval> expected,
          double tolerance) {
  std::erase_if(expected, [&](const StableInterval& interval) {
    return Near(interval.from, interval.to, 2 * tolerance);
  });
  std::vector<double> left = EdgesOf(got);
  for (const double edge : EdgesOf(expected)) {
    const auto nearest = std::min_element(left.begin(), left.end(), [&](double a, double b) {
      return std::abs(std::log(a / edge)) < std::abs(std::log(b / edge));
    });
    if (nearest == left.end() || !Near(edge, *nearest, tolerance)) return false;
    left.erase(nearest);
  }
  if (left.size() % 2 != 0) return false;
  for (std::size_t i = 0; i < left.size(); i += 2) {
    if (left[i + 1] > kScanStep * left[i]) return false;
  }
  return true;
}

// Whether all is stable from here on, but for gaps that such a scan may miss.
bool IsLeastStable(const std::vector<StableInterval>& got, double expected, double tolerance) {
  if (got.empty() || got.back().to < kGreatestMass) return false;
  for (std::size_t i = got.size(); i-- > 0;) {
    if (Near(got[i].from, expected, tolerance)) return true;
    if (i > 0 && got[i].from > kScanStep * got[i - 1].to) return false;
  }
  return false;
}

MultirateLoop ParseMassLoop(const Row& row, LoopMethod method) {
  MultirateLoop loop;
  loop.method = method;
  loop.hand = ParseHand(row);
  loop.stiffness_n_per_m = row.Number("kp_N_m", 1e-3, 1e6);
  loop.damping_ns_per_m = row.Number("kd_Ns_m", 0, 1e4);
  loop.period_s = row.NumberOr("T_s", 1e-6, 1, loop.period_s);
  const double ratio = row.Number("Tw_s", 1e-6, 100) / loop.period_s;
  if (std::abs(ratio - std::round(ratio)) > 1e-6 * ratio || !(std::round(ratio) >= 1) ||
      ratio > kMostTicks) {
    row.Refuse("Tw_s", "a whole number of haptic periods (T_s, or 1 ms) is expected");
  }
  loop.ticks_per_period = static_cast<int>(std::lround(ratio));
  if (row.Find("frame_latency_ticks")) {
    loop.latency_ticks = row.Integer("frame_latency_ticks", 0, 1'000'000);
    CheckLatency(row, "frame_latency_ticks", loop);
  }
  return loop;
}

Outcome RunMasses(const Row& row, std::uint64_t /*seed*/) {
  const auto method = FindLoopMethod(row.Text("method"));
  if (!method) return {RowStatus::kUnsupported, {}};
  const std::vector<StableInterval> intervals =
      StableIntervals(PeriodMap(ParseMassLoop(row, *method)));
  const bool ends_stable = !intervals.empty() && intervals.back().to >= kGreatestMass;
  const double least =
      ends_stable ? intervals.back().from : std::numeric_limits<double>::quiet_NaN();
  return {RowStatus::kOk, {least}, {ToText(intervals)}};
}

bool MassesAgree(const Row& row, const Outcome& outcome, std::size_t index) {
  const double tolerance = MassTolerance(row.Text("method"));
  const std::vector<StableInterval> got = ParseIntervals(outcome.texts[0]).value();
  if (index == kLeastStable) {
    const double expected = ExpectedNumber(row, kMassColumn);
    if (std::isfinite(expected)) return IsLeastStable(got, expected, tolerance);
    return !std::isfinite(outcome.values[kLeastStable]);
  }
  const auto expected = ParseIntervals(row.Text(kIntervalColumn));
  if (!expected) row.Refuse(kIntervalColumn, "from..to;from..inf is expected");
  return Same(got, *expected, tolerance);
}

Table MassGrid(bool quick) {
  Table table("the grid of multirate",
              {"Tw_s", "kp_N_m", "kd_Ns_m", "hand", "method", "frame_latency_ticks"});
  const std::vector<double> periods = quick ? std::vector{0.05} : std::vector{0.02, 0.05, 0.1, 0.2};
  for (const double damping : quick ? std::vector{2.0} : std::vector{0.0, 2.0}) {
    for (const double period_s : periods) {
      const auto ticks = std::lround(period_s * 1e3);
      for (const long latency : quick ? std::vector{0L} : std::vector{0L, ticks}) {
        for (const NamedHand& hand : kHands) {
          for (const char* method : {"conv", "impulse_interp", "impulse_hold", "local_SE",
                                     "local_AUTH", "local_M1_implicit"}) {
            table.Append({ToField(period_s), "2000", ToField(damping), hand.name, method,
                          std::to_string(latency)});
          }
        }
      }
    }
  }
  return table;
}

// What a lab wants to know: from which mass on an object is safe, by method and by hand.
void SummariseMasses(const Table& rows, const std::vector<Outcome>& outcomes, std::ostream& out) {
  std::vector<std::string> hands;
  std::vector<std::string> lines;  // setting and method, in the order of the rows
  std::map<std::pair<std::string, std::string>, std::string> cells;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Row row = rows.row(i);
    const auto text = [&](const char* column) { return row.Find(column).value_or("0"); };
    std::ostringstream line;
    line << std::left << std::setw(8) << text("Tw_s") << std::setw(9) << text("kp_N_m")
         << std::setw(7) << text("kd_Ns_m") << std::setw(8) << text("frame_latency_ticks")
         << std::setw(19) << text("method");
    const std::string hand = text("hand");
    if (std::find(hands.begin(), hands.end(), hand) == hands.end()) hands.push_back(hand);
    if (std::find(lines.begin(), lines.end(), line.str()) == lines.end()) {
      lines.push_back(line.str());
    }
    std::string cell = "?";
    if (!outcomes[i].values.empty()) {
      const double least = outcomes[i].values[kLeastStable];
      if (std::isfinite(least)) {
        cell = least <= kLeastMass ? "any" : MassText(least);
      } else {
        const auto intervals = ParseIntervals(outcomes[i].texts[0]).value();
        cell = intervals.empty()
                   ? "none"
                   : MassText(intervals.back().from) + ".." + MassText(intervals.back().to);
      }
    }
    cells[{line.str(), hand}] = cell;
  }
  if (lines.empty()) return;
  out << "Mass [kg] from which on every object is stable; a..b: the highest stable range, unstable "
         "above it too\n"
      << std::left << std::setw(8) << "Tw [s]" << std::setw(9) << "kp" << std::setw(7) << "kd"
      << std::setw(8) << "latency" << std::setw(19) << "method";
  for (const std::string& hand : hands) out << std::setw(17) << hand;
  out << "\n";
  for (const std::string& line : lines) {
    out << line;
    for (const std::string& hand : hands) out << std::setw(17) << cells[{line, hand}];
    out << "\n";
  }
  out << std::right;
}

// --- Growth of every method ---

Outcome RunGrowth(const Row& row, std::uint64_t /*seed*/) {
  MultirateLoop loop;
  loop.hand = haptic::Impedance{.mass_kg = row.Number("m", 1e-6, 1e6),
                                .damping_ns_per_m = row.Number("b", 0, 1e6),
                                .stiffness_n_per_m = row.Number("kh", 0, 1e9)};
  loop.stiffness_n_per_m = row.Number("kp", 1e-3, 1e6);
  loop.damping_ns_per_m = row.Number("kd", 0, 1e6);
  loop.period_s = row.Number("T", 1e-6, 1);
  loop.ticks_per_period = row.Integer("n", 1, kMostTicks);
  loop.latency_ticks = row.Find("L") ? row.Integer("L", 0, 1'000'000) : 0;
  CheckLatency(row, "L", loop);
  const double mass = row.Number("M", 1e-9, 1e9);
  Outcome outcome;
  for (std::size_t i = 0; i < kLoopMethodNames.size(); ++i) {
    loop.method = static_cast<LoopMethod>(i);
    outcome.values.push_back(PeriodMap(loop).SpectralRadius(mass));
  }
  return outcome;
}

// numerics section 6: log(rho) within 0.01 + 2 % where 0.9 < rho < 1.5. Elsewhere growth or decay is
// so fast that only its size matters, and what dies within a period is not told apart.
bool GrowthAgrees(const Row& row, const Outcome& outcome, std::size_t index) {
  const double expected = ExpectedNumber(row, kLoopMethodNames[index]);
  const double got = outcome.values[index];
  if (!std::isfinite(expected)) return !std::isfinite(got) || got > 1e100;
  if (expected < 1e-4 && got < 1e-4) return true;
  const double rate = std::log(expected);
  const bool scored = expected > 0.9 && expected < 1.5;
  return std::abs(std::log(got) - rate) <=
         (scored ? 0.01 + 0.02 * std::abs(rate) : 0.05 + 0.05 * std::abs(rate));
}

void SummariseGrowth(const Table& rows, const std::vector<Outcome>& outcomes, std::ostream& out) {
  out << "Of " << rows.size() << " random loops, those in which a deviation grows, and the median "
      << "growth per world period\n"
      << std::left << std::setw(20) << "method" << std::right << std::setw(10) << "unstable"
      << std::setw(14) << "median"
      << "\n";
  for (std::size_t method = 0; method < kLoopMethodNames.size(); ++method) {
    std::vector<double> growths;
    for (const Outcome& outcome : outcomes) growths.push_back(outcome.values[method]);
    if (growths.empty()) return;
    std::sort(growths.begin(), growths.end());
    const auto unstable =
        std::count_if(growths.begin(), growths.end(), [](double rho) { return rho > 1 + 1e-9; });
    out << std::left << std::setw(20) << kLoopMethodNames[method] << std::right << std::setw(10)
        << unstable << std::setw(14) << growths[growths.size() / 2] << "\n";
  }
}

}  // namespace

Case MultirateMasses() {
  Case study;
  study.name = "multirate";
  study.purpose = "which masses are stable, by coupling, hand and world period (nothing random)";
  study.results = {{kMassColumn}, {kIntervalColumn}};
  study.takes = [](const Table& table) { return table.Has("method"); };
  study.grid = MassGrid;
  study.run = RunMasses;
  study.agrees = MassesAgree;
  study.summarise = SummariseMasses;
  return study;
}

Case MultirateGrowth() {
  Case study;
  study.name = "multirate";
  study.purpose = "... or, on rows with n and M, the growth per world period of every coupling";
  for (const std::string_view method : kLoopMethodNames)
    study.results.push_back({std::string(method)});
  study.takes = [](const Table& table) { return table.Has("n") && table.Has("M"); };
  study.run = RunGrowth;
  study.agrees = GrowthAgrees;
  study.summarise = SummariseGrowth;
  return study;
}

}  // namespace rikiseki::lab
