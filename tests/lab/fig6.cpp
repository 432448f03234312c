// SPDX-License-Identifier: MIT
#include "tests/lab/fig6.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iomanip>
#include <limits>
#include <optional>
#include <ostream>
#include <stdexcept>

namespace rikiseki::lab {
namespace {

constexpr double kRunawaySpeed = 1e6;  // m/s: nothing on a lab's floor, but a loop that diverged

double DefaultFriction(PushScenario scenario) {
  return scenario == PushScenario::kPoke ? 0.1 : 0.3;
}

// The phase comes last: what stands before it makes a setting.
const std::vector<std::string> kColumns = {"scenario", "world_rule", "Tw_s",   "kp",
                                           "kd",       "M",          "method", "phase_ticks"};

struct Method {
  const char* name;  // in the tables
  protocol::Coupling coupling;
  haptic::DisplayRule display;
  LocalVariant local = LocalVariant::kTicks;
};

constexpr Method kMethods[] = {
    {"conv", protocol::Coupling::kPosition, haptic::DisplayRule::kInterpolate},
    {"impulse_interp", protocol::Coupling::kImpulse, haptic::DisplayRule::kInterpolate},
    {"impulse_hold", protocol::Coupling::kImpulse, haptic::DisplayRule::kHold},
    {"impulse_extrap", protocol::Coupling::kImpulse, haptic::DisplayRule::kExtrapolate},
    {"local_SE", protocol::Coupling::kLocal, haptic::DisplayRule::kInterpolate,
     LocalVariant::kLump},
    {"local_M1", protocol::Coupling::kLocal, haptic::DisplayRule::kInterpolate,
     LocalVariant::kBlock},
    {"local_AUTH", protocol::Coupling::kLocal, haptic::DisplayRule::kInterpolate,
     LocalVariant::kTicks},
};

// Nothing for a method that is not built.
std::optional<BlockPush> ParsePush(const Row& row) {
  BlockPush push;
  const std::string name = row.Text("method");
  const auto* method = std::find_if(std::begin(kMethods), std::end(kMethods),
                                    [&](const Method& known) { return known.name == name; });
  if (method == std::end(kMethods)) return std::nullopt;
  push.coupling = method->coupling;
  push.display = method->display;
  push.local = method->local;

  const std::string scenario = row.Text("scenario");
  if (scenario != "P" && scenario != "H") row.Refuse("scenario", "P or H is expected");
  push.scenario = scenario == "P" ? PushScenario::kPoke : PushScenario::kPush;

  const std::string rule = row.Text("world_rule");
  if (rule == "EX") {
    push.world = PushedWorld::kExactSlide;
  } else if (rule == "SE") {
    push.world = PushedWorld::kSemiImplicitSlide;
  } else if (rule == "BULLET") {
    push.world = PushedWorld::kBullet;
  } else {
    row.Refuse("world_rule", "EX, SE or BULLET is expected");
  }

  push.haptic_period_s = row.NumberOr("T_s", 1e-4, 0.1, push.haptic_period_s);
  push.world_period_s = row.Number("Tw_s", 1e-4, 10);
  const double ratio = push.world_period_s / push.haptic_period_s;
  if (std::abs(ratio - std::round(ratio)) > 1e-9 * ratio || std::round(ratio) < 1) {
    row.Refuse("Tw_s", "a whole number of haptic periods T_s is expected");
  }
  push.stiffness_n_per_m = row.Number("kp", 0, 1e6);
  push.damping_ns_per_m = row.Number("kd", 0, 1e4);
  push.mass_kg = row.Number("M", 1e-6, 1e6);
  push.friction = row.NumberOr("mu", 0, 10, DefaultFriction(push.scenario));
  push.phase_ticks = row.Integer("phase_ticks", 0, 1'000'000);
  return push;
}

Outcome RunRow(const Row& row, std::uint64_t /*seed*/) {
  const std::optional<BlockPush> push = ParsePush(row);
  if (!push) return {RowStatus::kUnsupported, {}};
  BlockPushResult result;
  try {
    result = SimulateBlockPush(*push);
  } catch (const std::invalid_argument& error) {
    row.Refuse("Tw_s", error.what());
  }
  const bool diverged =
      !std::isfinite(result.final_position_m) || !(result.peak_speed_m_per_s < kRunawaySpeed);
  return {diverged ? RowStatus::kUnstable : RowStatus::kOk,
          {result.final_position_m, result.total_impulse_ns, result.peak_speed_m_per_s}};
}

Table Grid(bool quick) {
  Table table("the grid of fig6", kColumns);
  struct Block {
    const char* scenario;
    double mass_kg;
    double world_period_s;
    const char* rule;
  };
  std::vector<Block> blocks{{"P", 0.5, 0.05, "EX"}, {"H", 2, 0.05, "EX"}};
  if (!quick) {
    blocks.clear();
    for (const char* scenario : {"P", "H"}) {
      for (const double mass_kg : {0.5, 2.0}) {
        for (const double world_period_s : {0.02, 0.05}) {
          for (const char* rule : {"EX", "SE", "BULLET"}) {
            blocks.push_back({scenario, mass_kg, world_period_s, rule});
          }
        }
      }
    }
  }
  constexpr int kPhases = 5;
  for (const Block& block : blocks) {
    for (const Method& method : kMethods) {
      for (int phase = 0; phase < kPhases; ++phase) {
        const auto ticks = std::lround(block.world_period_s / 1e-3) * phase / kPhases;
        table.Append({block.scenario, block.rule, ToField(block.world_period_s), "2000", "0",
                      ToField(block.mass_kg), method.name, std::to_string(ticks)});
      }
    }
  }
  return table;
}

struct Spread {
  int phases = 0;
  double sum = 0;
  double least = std::numeric_limits<double>::infinity();
  double most = -std::numeric_limits<double>::infinity();
};

// The experiment's own figure: for every setting and method how much the phase matters.
void Summarise(const Table& rows, const std::vector<Outcome>& outcomes, std::ostream& out) {
  constexpr std::array<int, 7> kWidths{10, 12, 8, 8, 8, 8, 16};
  using Setting = std::array<std::string, kWidths.size()>;  // all columns but the phase
  std::vector<std::pair<Setting, Spread>> spreads;          // in the order of the rows
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (outcomes[i].values.empty()) continue;
    Setting setting;
    for (std::size_t j = 0; j < setting.size(); ++j) setting[j] = rows.row(i).Text(kColumns[j]);
    auto known = std::find_if(spreads.begin(), spreads.end(),
                              [&](const auto& entry) { return entry.first == setting; });
    if (known == spreads.end()) known = spreads.insert(spreads.end(), {setting, {}});
    const double position = outcomes[i].values[0];
    Spread& spread = known->second;
    ++spread.phases;
    spread.sum += position;
    spread.least = std::min(spread.least, position);
    spread.most = std::max(spread.most, position);
  }
  if (spreads.empty()) return;

  out << "Final position of the block [mm] over the sampling phases of the world\n" << std::left;
  for (std::size_t j = 0; j < kWidths.size(); ++j) out << std::setw(kWidths[j]) << kColumns[j];
  out << std::right << std::setw(6) << "phases" << std::setw(11) << "mean" << std::setw(11)
      << "spread"
      << "\n"
      << std::fixed << std::setprecision(2);
  for (const auto& [setting, spread] : spreads) {
    out << std::left;
    for (std::size_t j = 0; j < kWidths.size(); ++j) out << std::setw(kWidths[j]) << setting[j];
    out << std::right << std::setw(6) << spread.phases << std::setw(11)
        << spread.sum / spread.phases * 1e3 << std::setw(11) << (spread.most - spread.least) * 1e3
        << "\n";
  }
}

}  // namespace

Case Fig6() {
  Case study;
  study.name = "fig6";
  study.purpose = "one push of a block for several sampling phases of the world (nothing random)";
  study.results = {{"x_final_m", 1e-9}, {"Jtot_Ns", 1e-8}, {"v_peak_world_m_s", 1e-8}};
  study.grid = Grid;
  study.run = RunRow;
  study.summarise = Summarise;
  return study;
}

}  // namespace rikiseki::lab
