// SPDX-License-Identifier: MIT
// A hand stirs in every scene of the gallery: what must hold of any scene holds, and the same run gives
// the same bits again, in this process and in others.
#include "tests/lab/gallery.h"

#include <catch2/catch.hpp>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "tests/common/temporary_folder.h"
#include "tests/lab/stir_run.h"
#include "world_server/scene/sdf_loader.h"

namespace rikiseki::lab {
namespace {

struct GalleryScene {
  std::string path;
  world::Scene scene;
};

bool Full() {
  return std::getenv("RIKISEKI_FULL") != nullptr;
}

// Large ones take their time: only in the long form.
const std::vector<GalleryScene>& Scenes() {
  static const std::vector<GalleryScene> kScenes = [] {
    std::vector<GalleryScene> scenes;
    for (const std::string& path : GalleryScenes()) {
      world::Scene scene = world::LoadSdf(path).scene;
      if (Full() || scene.bodies.size() <= 100) scenes.push_back({path, std::move(scene)});
    }
    return scenes;
  }();
  return kScenes;
}

std::string Text(std::uint64_t hash) {
  char text[17];
  std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(hash));
  return text;
}

// The hashes of all rows, by a process of its own whose memory lies elsewhere and is filled otherwise.
std::vector<std::string> HashesOfChild(const TemporaryFolder& folder, const std::string& cases,
                                       const std::string& environment) {
  const std::string out = folder.File("out.csv");
  const std::string command = environment + " " + RIKISEKI_BIN_DIR +
                              "/haptic_lab gallery --jobs 1 --cases " + cases + " --out " + out +
                              " > /dev/null";
  REQUIRE(std::system(command.c_str()) == 0);
  const Table table = Table::Load(out);
  std::vector<std::string> hashes;
  for (std::size_t i = 0; i < table.size(); ++i) hashes.push_back(table.row(i).Text("got_hash"));
  return hashes;
}

}  // namespace

TEST_CASE("a hand stirs in every scene: finite, bounded, below cap and slew limit, balanced") {
  REQUIRE(GalleryScenes().size() >= 11);
  for (const auto& [path, scene] : Scenes()) {
    const StirResult got = SimulateStir({.scene = scene, .duration_s = Full() ? 60.0 : 3.0});
    CAPTURE(path, got.work_j, got.energy_excess_j, got.force_peak_n, got.farthest_m);
    CHECK(Broken(got) == "");
    if (Full()) CHECK(got.force_peak_n > 0.5);  // it met something
  }
}

// It had 31 kJ after 6 s while it had no copy: kicks of a world period into 50 g, and then, where it no
// longer was, at levers of metres.
TEST_CASE("a light body that is squeezed onto a jointed one gets no energy from nowhere") {
  const world::Scene scene = world::LoadSdf(RIKISEKI_SOURCE_DIR
                                            "/config/scenes"
                                            "/turntable.sdf")
                                 .scene;
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    for (const double rate_hz : {10.0, 20.0}) {
      const StirResult got =
          SimulateStir({.scene = scene, .duration_s = 6, .world_rate_hz = rate_hz, .seed = seed});
      CAPTURE(seed, rate_hz, got.work_j, got.energy_peak_j, got.force_peak_n);
      CHECK(Broken(got) == "");
    }
  }
}

// Chains of more touching bodies than there are copies for. They had up to 3.8 and 29 J from nowhere, within
// the first 6 s, before such bodies were held to the finger's work.
TEST_CASE("bodies without local copies get no energy from nowhere, however slow the world") {
  for (const char* name : {"stack.sdf", "thousand.sdf"}) {
    const world::Scene scene =
        world::LoadSdf(RIKISEKI_SOURCE_DIR "/config/scenes/" + std::string(name)).scene;
    for (const std::uint64_t seed : {2U, 3U}) {
      for (const double rate_hz : {10.0, 20.0}) {
        const StirResult got =
            SimulateStir({.scene = scene, .duration_s = 3, .world_rate_hz = rate_hz, .seed = seed});
        CAPTURE(name, seed, rate_hz, got.work_j, got.energy_excess_j, got.discarded_ns);
        CHECK(Broken(got) == "");
      }
    }
  }
}

TEST_CASE("the same run gives the same bits again, in this process and in others") {
  const TemporaryFolder folder;
  std::string rows = "scene,seconds\n";
  std::vector<std::string> here;
  const double seconds = Full() ? 10 : 1;
  for (const auto& [path, scene] : Scenes()) {
    rows += path + "," + ToField(seconds) + "\n";
    const Stir stir{.scene = scene, .duration_s = seconds};
    here.push_back(Text(SimulateStir(stir).hash));
    CAPTURE(path);
    CHECK(Text(SimulateStir(stir).hash) == here.back());
  }
  const std::string cases = folder.Write("cases.csv", rows);
  CHECK(HashesOfChild(folder, cases, "MALLOC_PERTURB_=85") == here);
  CHECK(HashesOfChild(folder, cases, "MALLOC_PERTURB_=170 MALLOC_MMAP_THRESHOLD_=1024") == here);

  const auto& [path, scene] = Scenes().front();
  const std::uint64_t other_hand =
      SimulateStir({.scene = scene, .duration_s = seconds, .seed = 2}).hash;
  CHECK(Text(other_hand) != here.front());
}

}  // namespace rikiseki::lab
