// SPDX-License-Identifier: MIT
#include <set>

#include "tests/lab/report/sections.h"
#include "world_server/scene/needs.h"
#include "world_server/scene/sdf_loader.h"

namespace rikiseki::lab {
namespace {

std::string LeftOut(const std::string& scene, std::string& needs) {
  const world::SceneNeeds found =
      world::WorkOutNeeds(world::LoadSdf(RIKISEKI_SCENES_DIR "/" + scene).scene);
  needs = world::InWords(found.needs);
  return world::InWords(found.left_out);
}

void WriteGallery(const std::vector<ResultRow>& rows, Html& page) {
  page.Paragraph(
      "Each scene of config/scenes: what its bodies and surfaces need of the world, what is "
      "therefore not in its engine, its messages and its haptic tick, and what a world tick of 50 "
      "ms "
      "costs while a simulated hand stirs in it. Energy is what the bodies ever had beyond what "
      "the "
      "finger and the start gave them; every force was finite, below the cap and within the slew "
      "limit where the last column says ok.");
  std::vector<std::vector<std::string>> lines;
  for (const ResultRow& row : rows) {
    std::string needs;
    const std::string left_out = LeftOut(row.Text("scene"), needs);
    lines.push_back({row.Text("scene"), needs, left_out, Value(row.Got("world_us_p50")),
                     Value(row.Got("world_us_p99")), Value(1e3 * row.Got("energy_excess_j")),
                     Value(1e3 * row.Got("jump_max_m")),
                     row.status == RowStatus::kOk ? "ok" : "MISSED"});
  }
  page.Table({"scene", "needs", "left out", "world tick us p50", "p99", "energy mJ", "jump mm", ""},
             lines);
  Repeat("gallery", "gallery", rows, page);
}

void WriteCosts(const std::vector<ResultRow>& rows, Html& page) {
  page.Subheading("What each part costs");
  page.Paragraph(
      "Median times in microseconds of a haptic tick in contact and of a world tick: with the part "
      "in and acting; left out because the scene has no use for it; and switched off. The last two "
      "must be the same computation, bit by bit. Wall clock; runs are interleaved.");
  std::vector<std::vector<std::string>> lines;
  std::size_t different = 0;
  for (const ResultRow& row : rows) {
    const bool identical = row.Got("identical") == 1;
    different += identical ? 0 : 1;
    lines.push_back({row.Text("scene") + ": " + row.Text("feature"), Value(row.Got("haptic_in_us")),
                     Value(row.Got("haptic_left_out_us")), Value(row.Got("haptic_switched_out_us")),
                     Value(row.Got("world_in_us")), Value(row.Got("world_left_out_us")),
                     Value(row.Got("world_switched_out_us")),
                     identical ? "identical" : "DIFFERENT"});
  }
  if (different > 0) page.Warning(std::to_string(different) + " parts change bits when left out.");
  page.Table({"scene: part", "haptic in", "left out", "switched off", "world in", "left out",
              "switched off", "bits"},
             lines);
  Repeat("scene-cost --jobs 1", "scene-cost", rows, page);
}

}  // namespace

void WriteScenes(const Results& results, Html& page) {
  page.Heading("What scenes leave out", "scenes");
  if (const auto& rows = RowsOf(results, "gallery"); !rows.empty()) WriteGallery(rows, page);
  if (const auto& rows = RowsOf(results, "scene-cost"); !rows.empty()) WriteCosts(rows, page);
}

}  // namespace rikiseki::lab
