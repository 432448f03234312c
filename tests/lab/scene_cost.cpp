// SPDX-License-Identifier: MIT
#include "tests/lab/scene_cost.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <iomanip>
#include <ostream>
#include <stdexcept>

#include "common/config.h"
#include "tests/lab/feature_switches.h"
#include "tests/lab/push_script.h"
#include "tests/lab/touch_run.h"
#include "world_server/scene/sdf_loader.h"

namespace rikiseki::lab {
namespace {

// Beside the scenes of config/scenes: two that only the laboratory has.
const char* const kNeighbours = "neighbours";       // two cubes on a floor, 1 mm apart
const char* const kFarNeighbour = "far_neighbour";  // likewise, 5 m apart

// Median times of one way to run a touch [us].
enum Time { kHaptic, kWorld };
const std::array<const char*, 3> kWays{"in", "left_out", "switched_out"};
constexpr std::size_t kIdentical = 6;  // after the six times

world::Scene SceneOf(const Row& row) {
  const std::string name = row.Text("scene");
  const auto cubes = [](double gap_m) {
    return PushScene(
        {.script = PushScript::kNeighbour, .mass_kg = 0.5, .gap_m = gap_m, .neighbour_kg = 0.5});
  };
  if (name == kNeighbours) return cubes(0.001);
  if (name == kFarNeighbour) return cubes(5);
  const std::filesystem::path path(name);
  const bool has_folder = path.has_parent_path();
  return world::LoadSdf(has_folder ? name : RIKISEKI_SCENES_DIR "/" + name).scene;
}

FeatureSwitch FeatureOf(const Row& row) {
  const std::string name = row.Text("feature");
  std::string known;
  for (const FeatureSwitch& feature : FeatureSwitches()) {
    if (feature.name == name) return feature;
    known += (known.empty() ? "" : ", ") + feature.name;
  }
  row.Refuse("feature", "one of " + known + " is expected");
}

double Median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

Outcome RunRow(const Row& row, std::uint64_t /*seed*/) {
  const world::Scene scene = SceneOf(row);
  const FeatureSwitch feature = FeatureOf(row);
  const int repetitions = row.Integer("repetitions", 1, 1000);
  std::array<Touch, 3> touches;
  try {
    touches.fill(TouchOf(scene));
  } catch (const std::invalid_argument& error) {
    row.Refuse("scene", error.what());
  }
  feature.in(touches[0]);
  feature.left_out(touches[1]);
  feature.switched_out(touches[2]);

  // The three in turn, so that a busy computer is busy for all of them.
  std::array<std::array<std::vector<double>, 2>, 3> medians;
  bool identical = true;
  for (int i = 0; i < repetitions; ++i) {
    std::array<TouchResult, 3> results;
    for (std::size_t way = 0; way < touches.size(); ++way) {
      results[way] = RunTouch(touches[way]);
      medians[way][kHaptic].push_back(Median(results[way].haptic_us));
      medians[way][kWorld].push_back(Median(results[way].world_us));
    }
    identical = identical && SameMotion(results[1], results[2]);
  }
  Outcome outcome;
  outcome.status = identical ? RowStatus::kOk : RowStatus::kMissed;
  for (const auto& way : medians) {
    for (const std::vector<double>& time : way) outcome.values.push_back(Median(time));
  }
  outcome.values.push_back(identical ? 1 : 0);
  return outcome;
}

std::vector<std::string> Scenes(bool quick) {
  if (quick) return {"push.sdf"};
  std::vector<std::string> scenes;
  for (const auto& entry : std::filesystem::directory_iterator(RIKISEKI_SCENES_DIR)) {
    if (entry.path().extension() == ".sdf") scenes.push_back(entry.path().filename());
  }
  std::sort(scenes.begin(), scenes.end());
  scenes.insert(scenes.end(), {kNeighbours, kFarNeighbour});
  return scenes;
}

Table Grid(bool quick) {
  Table table("the grid of scene-cost", {"scene", "feature", "repetitions"});
  for (const std::string& scene : Scenes(quick)) {
    for (const FeatureSwitch& feature : FeatureSwitches()) {
      table.Append({scene, feature.name, quick ? "1" : "5"});
    }
  }
  return table;
}

void Summarise(const Table& rows, const std::vector<Outcome>& outcomes, std::ostream& out) {
  std::string scene;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Row row = rows.row(i);
    const std::vector<double>& got = outcomes[i].values;
    if (got.size() <= kIdentical) continue;
    if (row.Text("scene") != scene) {
      scene = row.Text("scene");
      out << std::left << std::setw(24) << scene << std::right << std::setw(32)
          << "haptic tick in contact, us" << std::setw(36) << "world tick, us"
          << "\n"
          << std::setw(24) << "";
      for (int loop = 0; loop < 2; ++loop) {
        out << std::setw(10) << "in" << std::setw(11) << "left out" << std::setw(11) << "switched"
            << (loop == 0 ? "    " : "  bits\n");
      }
    }
    out << "  " << std::left << std::setw(22) << row.Text("feature") << std::right << std::fixed;
    for (const Time loop : {kHaptic, kWorld}) {
      out << std::setprecision(loop == kHaptic ? 2 : 0) << std::setw(10) << got[loop]
          << std::setw(11) << got[2 + loop] << std::setw(11) << got[4 + loop]
          << (loop == kHaptic ? "    " : "  ");
    }
    out << std::defaultfloat << (got[kIdentical] == 1 ? "identical" : "DIFFERENT") << "\n";
  }
  out << "Median of interleaved runs. left out: on, with nothing to do; switched: switched out.\n";
}

}  // namespace

Case SceneCost() {
  Case study;
  study.name = "scene-cost";
  study.purpose =
      "what each feature costs in each scene, in, left out and switched out (wall clock; --jobs 1)";
  for (const char* way : kWays) {
    study.results.push_back({std::string("haptic_") + way + "_us"});
    study.results.push_back({std::string("world_") + way + "_us"});
  }
  study.results.push_back({"identical"});
  study.grid = Grid;
  study.run = RunRow;
  study.summarise = Summarise;
  return study;
}

}  // namespace rikiseki::lab
