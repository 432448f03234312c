// SPDX-License-Identifier: MIT
#include "tests/lab/push_traces.h"

#include <cmath>
#include <ostream>
#include <stdexcept>
#include <vector>

#include "protocol/impulse_units.h"
#include "tests/lab/block_push.h"
#include "tests/lab/choose.h"
#include "tests/lab/coupling_column.h"

namespace rikiseki::lab {
namespace {

constexpr double kDuration = 1.5;  // s, by then every block rests or nearly so
constexpr int kEvery = 5;          // ticks between two points

constexpr Named<PushScenario> kScenarios[] = {{"P", PushScenario::kPoke},
                                              {"H", PushScenario::kPush}};

Outcome RunRow(const Row& row, std::uint64_t /*seed*/) {
  BlockPush push;
  push.scenario = Choose(row, "scenario", kScenarios);
  push.friction = push.scenario == PushScenario::kPoke ? 0.1 : 0.3;
  push.coupling = Choose(row, "coupling", kCouplings);
  push.mass_kg = row.Number("M", 1e-6, 1e6);
  push.world_period_s = row.Number("Tw_s", 1e-3, 1);
  push.phase_ticks = row.Integer("phase_ticks", 0, 1'000'000);
  std::string positions;
  std::string impulses;
  double position = 0;
  try {
    const PreparedRun prepared = PrepareBlockPush(push, HandOf(push.scenario));
    for (long long k = 0; k < std::llround(kDuration / push.haptic_period_s); ++k) {
      prepared.loops->Tick();
      if (k % kEvery != 0) continue;
      position = prepared.loops->world().Bodies()[0].position[0];
      const auto& books = prepared.loops->haptic_health().books;
      positions.append(k == 0 ? "" : " ").append(ToField(position));
      impulses.append(k == 0 ? "" : " ").append(ToField(protocol::InSi(books.displayed)[0]));
    }
  } catch (const std::invalid_argument& error) {
    row.Refuse("Tw_s", error.what());
  }
  return {std::isfinite(position) ? RowStatus::kOk : RowStatus::kUnstable,
          {kEvery * push.haptic_period_s},
          {positions, impulses}};
}

Table Grid(bool /*quick*/) {
  Table table("the grid of fig6-traces", {"scenario", "coupling", "M", "Tw_s", "phase_ticks"});
  constexpr int kPhases = 5;
  constexpr double kWorldPeriod = 0.05;
  for (const auto& [scenario, mass_kg] : {std::pair("P", 0.5), std::pair("H", 2.0)}) {
    for (const auto& coupling : kCouplings) {
      for (int phase = 0; phase < kPhases; ++phase) {
        const auto ticks = std::lround(kWorldPeriod / 1e-3) * phase / kPhases;
        table.Append({scenario, coupling.name, ToField(mass_kg), ToField(kWorldPeriod),
                      std::to_string(ticks)});
      }
    }
  }
  return table;
}

void Summarise(const Table& rows, const std::vector<Outcome>& /*outcomes*/, std::ostream& out) {
  out << "Position [m] and displayed impulse [N s] of " << rows.size()
      << " pushes over time: --out F.csv has them\n";
}

}  // namespace

Case PushTraces() {
  Case study;
  study.name = "fig6-traces";
  study.purpose = "a push of a block over time, at several sampling phases (nothing random)";
  study.results = {{"step_s"}, {"positions_m"}, {"impulses_ns"}};
  study.grid = Grid;
  study.run = RunRow;
  study.summarise = Summarise;
  return study;
}

}  // namespace rikiseki::lab
