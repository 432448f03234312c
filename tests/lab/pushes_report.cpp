// SPDX-License-Identifier: MIT
#include "tests/lab/pushes_report.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <map>
#include <ostream>
#include <set>
#include <sstream>

#include "tests/lab/push_rows.h"

namespace rikiseki::lab {
namespace {

constexpr int kLabelWidth = 34;
constexpr int kCellWidth = 24;

// Where the finger stays in contact the force is the result, elsewhere the displacement.
bool IsAboutForce(PushScript script) {
  return script == PushScript::kPress || script == PushScript::kWall ||
         script == PushScript::kStick;
}

using SingleRates = std::map<std::vector<std::string>, std::vector<double>>;  // push -> results

SingleRates FindSingleRates(const Table& rows, const std::vector<Outcome>& outcomes) {
  SingleRates singles;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Row row = rows.row(i);
    if (row.Text("coupling") == kSingleRate && outcomes[i].values.size() > kYaw) {
      singles.emplace(PushOf(row), outcomes[i].values);
    }
  }
  return singles;
}

// The worst of some rows.
struct Deviation {
  bool diverged = false;
  double error = 0;  // of the mean, as a fraction
  double sd = 0;     // as a fraction
  double jump_m = 0;

  void Add(const Deviation& other) {
    diverged = diverged || other.diverged;
    if (!(std::abs(other.error) <= std::abs(error))) error = other.error;
    sd = std::max(sd, other.sd);
    jump_m = std::max(jump_m, other.jump_m);
  }
};

Deviation Compare(PushScript script, const Outcome& outcome, const std::vector<double>& single) {
  const std::vector<double>& got = outcome.values;
  const bool force = IsAboutForce(script);
  const std::size_t mean = force ? kForceMean : kDisplacementMean;
  return {.diverged = outcome.status == RowStatus::kUnstable,
          .error = got[mean] / single[mean] - 1,
          .sd = force ? std::abs(got[kForceSd] - single[kForceSd]) / std::abs(single[kForceMean])
                      : got[kDisplacementSd] / std::abs(single[kDisplacementMean]),
          .jump_m = got[kJumpMax]};
}

std::string Label(const Row& row, const CubePush& push) {
  std::ostringstream label;
  label << row.Text("script") << " " << push.mass_kg << " kg";
  if (push.stiffness_n_per_m != 2000) label << ", kp " << push.stiffness_n_per_m;
  if (push.damping_ns_per_m != 0) label << ", kd " << push.damping_ns_per_m;
  if (push.offset_m != 0) label << ", " << push.offset_m * 1e3 << " mm off";
  if (push.script == PushScript::kNeighbour) label << ", " << push.neighbour_kg << " kg behind";
  return label.str();
}

// Digits where they say something.
std::string Percent(double fraction) {
  std::ostringstream text;
  text << std::fixed << std::setprecision(std::abs(fraction) < 1 ? 2 : 0) << fraction * 100;
  return text.str();
}

std::string Cell(const Deviation& deviation) {
  if (deviation.diverged) return "diverged";
  std::ostringstream cell;
  cell << (deviation.error < 0 ? "" : "+") << Percent(deviation.error) << " / "
       << Percent(deviation.sd) << " / " << std::fixed << std::setprecision(3)
       << deviation.jump_m * 1e3;
  return cell.str();
}

void PrintCoupling(const std::string& coupling, const Table& rows,
                   const std::vector<Outcome>& outcomes, const SingleRates& singles,
                   std::ostream& out) {
  std::set<double> periods_s;
  std::vector<std::vector<std::string>> pushes;  // in the order of the rows
  std::map<std::vector<std::string>, std::pair<Row, std::map<double, Deviation>>> lines;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Row row = rows.row(i);
    const auto push = PushOf(row);
    const auto single = singles.find(push);
    if (row.Text("coupling") != coupling || single == singles.end() ||
        outcomes[i].values.size() <= kYaw) {
      continue;
    }
    const double period_s = ParseLoops(row).world_period_s;
    periods_s.insert(period_s);
    const auto [line, is_new] = lines.try_emplace(push, row, std::map<double, Deviation>{});
    if (is_new) pushes.push_back(push);
    line->second.second[period_s].Add(Compare(ParsePush(row).script, outcomes[i], single->second));
  }
  if (pushes.empty()) return;

  out << "coupling " << coupling << ": error of the mean % / SD % / largest jump mm\n"
      << std::left << std::setw(kLabelWidth) << "" << std::right << std::setw(12) << "single rate";
  for (const double period_s : periods_s) {
    std::ostringstream rate;
    rate << 1 / period_s << " Hz";
    out << std::setw(kCellWidth) << rate.str();
  }
  out << "\n";
  for (const auto& push : pushes) {
    const auto& [row, cells] = lines.at(push);
    const CubePush parsed = ParsePush(row);
    const bool force = IsAboutForce(parsed.script);
    const double single = singles.at(push)[force ? kForceMean : kDisplacementMean];
    std::ostringstream value;
    value << std::fixed << std::setprecision(force ? 4 : 3) << (force ? single : single * 1e3)
          << (force ? " N " : " mm");
    out << std::left << std::setw(kLabelWidth) << Label(row, parsed) << std::right << std::setw(12)
        << value.str();
    for (const double period_s : periods_s) {
      const auto cell = cells.find(period_s);
      out << std::setw(kCellWidth) << (cell == cells.end() ? "" : Cell(cell->second));
    }
    out << "\n";
  }
}

struct Bar {
  const char* of;
  double got;
  double limit;
};

std::vector<Bar> BarsFor(const Row& row, const std::vector<double>& got,
                         const std::vector<double>& single) {
  const PushScript script = ParsePush(row).script;
  const PushBars bars = BarsOf(script, ParseLoops(row).world_period_s);
  const auto off = [&](PushColumn column) { return std::abs(got[column] - single[column]); };
  const double displacement = std::abs(single[kDisplacementMean]);
  return {
      {"displacement_mean_m", off(kDisplacementMean),
       bars.displacement * displacement + bars.displacement_floor_m},
      {"displacement_sd_m", got[kDisplacementSd],
       bars.sd * displacement + bars.displacement_floor_m},
      {"force_mean_n", off(kForceMean), bars.force * std::abs(single[kForceMean])},
      {"force_peak_n", off(kForcePeak), bars.peak * std::abs(single[kForcePeak])},
      {"jump_max_m", got[kJumpMax], bars.jump_m},
      {"yaw_rad", off(kYaw), bars.yaw_rad},
  };
}

}  // namespace

void SummarisePushes(const Table& rows, const std::vector<Outcome>& outcomes, std::ostream& out) {
  const SingleRates singles = FindSingleRates(rows, outcomes);
  for (const char* coupling : {"position", "impulse", "local"}) {
    PrintCoupling(coupling, rows, outcomes, singles, out);
  }
}

std::size_t JudgePushes(const Table& rows, const std::vector<Outcome>& outcomes,
                        std::ostream& out) {
  const SingleRates singles = FindSingleRates(rows, outcomes);
  std::size_t missed = 0;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Row row = rows.row(i);
    const auto single = singles.find(PushOf(row));
    if (row.Text("coupling") != "local" || single == singles.end()) continue;
    for (const Bar& bar : BarsFor(row, outcomes[i].values, single->second)) {
      if (bar.got <= bar.limit) continue;
      ++missed;
      out << "missed: " << Label(row, ParsePush(row)) << ", Tw " << row.Text("Tw_s")
          << " s, latency " << row.Text("latency_ticks") << ": " << bar.of << " off by " << bar.got
          << ", at most " << bar.limit << "\n";
    }
  }
  return missed;
}

}  // namespace rikiseki::lab
