// SPDX-License-Identifier: MIT
#include "tests/lab/gallery.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <iomanip>
#include <ostream>

#include "tests/lab/stir_run.h"
#include "world_server/scene/sdf_loader.h"

namespace rikiseki::lab {
namespace {

const std::vector<ResultColumn> kResults = {
    {"finite"},        {"force_peak_n"}, {"over_cap_n"},      {"over_slew_n"},
    {"energy_peak_j"}, {"work_j"},       {"energy_excess_j"}, {"unaccounted_ns"},
    {"displayed_ns"},  {"discarded_ns"}, {"farthest_m"},      {"jump_max_m"},
    {"flagged"},       {"world_us_p50"}, {"world_us_p99"},    {"hash"}};
enum Result {
  kFinite,
  kForcePeak,
  kOverCap,
  kOverSlew,
  kEnergyPeak,
  kWork,
  kEnergyExcess,
  kUnaccounted,
  kDisplayed,
  kDiscarded,
  kFarthestColumn,
  kJump,
  kFlagged,
  kWorldMedian,
  kWorldWorst,
};

double Quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  const auto place = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + place, values.end());
  return values[static_cast<std::size_t>(place)];
}

Outcome RunRow(const Row& row, std::uint64_t seed) {
  const std::string name = row.Text("scene");
  const bool has_folder = std::filesystem::path(name).has_parent_path();
  const StirResult got = SimulateStir(
      {.scene = world::LoadSdf(has_folder ? name : RIKISEKI_SCENES_DIR "/" + name).scene,
       .duration_s = row.Number("seconds", 0.1, 1e4),
       .world_rate_hz = row.NumberOr("rate_hz", 1, 1000, 20),
       .passivity_controller = row.NumberOr("controller", 0, 1, 1) != 0,
       .low_m = row.NumberOr("low_m", -1, 0.04, -0.03),
       .seed = seed});
  char hash[17];
  std::snprintf(hash, sizeof hash, "%016llx", static_cast<unsigned long long>(got.hash));
  return {Broken(got).empty() ? RowStatus::kOk : RowStatus::kMissed,
          {got.finite ? 1.0 : 0.0, got.force_peak_n, got.over_cap_n, got.over_slew_n,
           got.energy_peak_j, got.work_j, got.energy_excess_j, got.unaccounted_ns, got.displayed_ns,
           got.discarded_ns, got.farthest_m, got.largest_jump_m, static_cast<double>(got.flagged),
           Quantile(got.world_us, 0.5), Quantile(got.world_us, 0.99)},
          {hash}};
}

Table Grid(bool quick) {
  Table table("the grid of gallery", {"scene", "seconds"});
  for (const std::string& scene : GalleryScenes()) {
    table.Append({std::filesystem::path(scene).filename(), quick ? "3" : "60"});
  }
  return table;
}

void Summarise(const Table& rows, const std::vector<Outcome>& outcomes, std::ostream& out) {
  out << std::left << std::setw(20) << "scene" << std::right << std::setw(6) << "s" << std::setw(20)
      << "world tick us 50/99" << std::setw(9) << "peak N" << std::setw(10) << "work J"
      << std::setw(10) << "bodies J" << std::setw(11) << "excess J" << std::setw(9) << "N s"
      << std::setw(10) << "discard" << std::setw(9) << "jump mm" << std::setw(7) << "flags"
      << "  hash\n";
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const std::vector<double>& got = outcomes[i].values;
    if (got.size() <= kWorldWorst) continue;
    out << std::left << std::setw(20) << rows.row(i).Text("scene") << std::right << std::setw(6)
        << rows.row(i).Text("seconds") << std::fixed << std::setprecision(0) << std::setw(11)
        << got[kWorldMedian] << " " << std::setw(8) << got[kWorldWorst] << std::setprecision(2)
        << std::setw(9) << got[kForcePeak] << std::setprecision(4) << std::setw(10) << got[kWork]
        << std::setw(10) << got[kEnergyPeak] << std::setprecision(6) << std::setw(11)
        << got[kEnergyExcess] << std::setprecision(3) << std::setw(9) << got[kDisplayed]
        << std::setw(10) << got[kDiscarded] << std::setw(9) << 1e3 * got[kJump]
        << std::setprecision(0) << std::setw(7) << got[kFlagged] << "  "
        << (outcomes[i].texts.empty() ? "" : outcomes[i].texts[0]) << std::defaultfloat
        << (outcomes[i].status == RowStatus::kMissed ? "  MISSED\n" : "\n");
  }
  out << "excess: the most that the bodies ever had beyond what start and finger gave. N s: "
         "impulse on "
         "bodies; discard: of it, declared not applied.\n";
}

}  // namespace

std::vector<std::string> GalleryScenes() {
  std::vector<std::string> scenes;
  for (const auto& entry : std::filesystem::directory_iterator(RIKISEKI_SCENES_DIR)) {
    if (entry.path().extension() == ".sdf") scenes.push_back(entry.path());
  }
  std::sort(scenes.begin(), scenes.end());
  return scenes;
}

Case Gallery() {
  Case study;
  study.name = "gallery";
  study.purpose =
      "a hand stirs in every scene of config/scenes: finite, energy, cap, slew, books, cost, hash";
  study.results = kResults;
  study.grid = Grid;
  study.run = RunRow;
  study.summarise = Summarise;
  return study;
}

}  // namespace rikiseki::lab
