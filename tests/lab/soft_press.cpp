// SPDX-License-Identifier: MIT
#include "tests/lab/soft_press.h"

#include <algorithm>
#include <array>
#include <ostream>

#include "tests/lab/coupling_column.h"
#include "tests/lab/soft_press_run.h"

namespace rikiseki::lab {
namespace {

// The plane of the mesh's unloaded surface and its compliance are exact; what is left is where the pad
// is, which the nearest point of the dented surface shifts.
constexpr double kLargestForceError = 0.01;  // of the force

enum SoftColumn : std::size_t { kForce, kSwing, kExpected, kDent, kFlagged };
const std::array<const char*, kFlagged + 1> kResults = {"force_n", "swing_n", "expected_n",
                                                        "dent_m", "flagged"};

Outcome RunRow(const Row& row, std::uint64_t /*seed*/) {
  SoftPress press;
  press.youngs_modulus_pa = row.NumberOr("youngs_modulus_pa", 1e2, 1e9, press.youngs_modulus_pa);
  press.force_n = row.NumberOr("press_n", 1e-3, 6, press.force_n);
  press.loops.coupling = Choose(row, "coupling", kCouplings);
  press.loops.rate_hz = row.Number("world_hz", 1, 200);
  press.loops.latency_periods = row.NumberOr("latency_periods", 0, 10, 0);
  const SoftPressed got = RunSoftPress(press);
  const double force = (got.least_n + got.most_n) / 2;
  const double off = std::max(got.most_n - got.expected_n, got.expected_n - got.least_n);
  const bool kept = !got.flagged && off <= kLargestForceError * got.expected_n;
  return {kept ? RowStatus::kOk : RowStatus::kMissed,
          {force, got.most_n - got.least_n, got.expected_n, got.dent_m, got.flagged ? 1.0 : 0.0}};
}

Table Grid(bool quick) {
  Table table("the grid of soft-press",
              {"youngs_modulus_pa", "press_n", "coupling", "world_hz", "latency_periods"});
  for (const char* modulus : {"3000", "8000", "1000000"}) {
    if (quick && std::string(modulus) != "8000") continue;
    for (const auto& coupling : kCouplings) {
      for (const char* world_hz : {"60", "20", "10"}) {
        for (const char* latency : {"0", "1", "2"}) {
          if (quick && std::string(latency) != "1") continue;
          table.Append({modulus, "2", coupling.name, world_hz, latency});
        }
      }
    }
  }
  return table;
}

void Summarise(const Table& rows, const std::vector<Outcome>& outcomes, std::ostream& out) {
  out << "What a finger feels of a soft block [N], how much that swings, and the springs in "
         "series\n";
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Row row = rows.row(i);
    const std::vector<double>& got = outcomes[i].values;
    out << row.Find("youngs_modulus_pa").value_or("") << " Pa, " << row.Text("coupling")
        << ", world " << row.Text("world_hz") << " Hz, latency "
        << row.Find("latency_periods").value_or("0") << " periods: " << got[kForce] << " ("
        << got[kSwing] << "), " << got[kExpected] << ", dent " << 1e3 * got[kDent] << " mm\n";
  }
}

}  // namespace

Case SoftPresses() {
  Case study;
  study.name = "soft-press";
  study.purpose =
      "a finger presses a soft block: its force against the two springs in series, at any "
      "coupling, "
      "world rate and latency (nothing random)";
  for (const char* name : kResults) study.results.push_back({name});
  study.grid = Grid;
  study.run = RunRow;
  study.summarise = Summarise;
  return study;
}

}  // namespace rikiseki::lab
