// SPDX-License-Identifier: MIT
// Every scene of config/scenes loads without a warning, is what its comment says, and moves sanely.
#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "world_server/physics/deformable_world.h"
#include "world_server/scene/needs.h"
#include "world_server/scene/sdf_loader.h"
#include "world_server/step.h"

namespace rikiseki::world {
namespace {

namespace fs = std::filesystem;

struct GalleryScene {
  std::string path;
  LoadedScene loaded;
};

// Read once: libsdformat takes its time.
const std::vector<GalleryScene>& Gallery() {
  static const std::vector<GalleryScene> kGallery = [] {
    std::vector<GalleryScene> scenes;
    for (const auto& entry : fs::directory_iterator(RIKISEKI_SOURCE_DIR "/config/scenes")) {
      if (entry.path().extension() == ".sdf") {
        scenes.push_back({entry.path(), LoadSdf(entry.path())});
      }
    }
    return scenes;
  }();
  return kGallery;
}

}  // namespace

TEST_CASE("the gallery loads, and says truly what each scene needs and leaves out") {
  REQUIRE(Gallery().size() >= 11);
  for (const auto& [path, loaded] : Gallery()) {
    CAPTURE(path);
    CHECK(loaded.warnings == std::vector<std::string>{});
    std::ifstream file(path);
    const std::string text{std::istreambuf_iterator<char>(file), {}};
    const SceneNeeds needs = WorkOutNeeds(loaded.scene);
    CHECK(text.find("\n  needs: " + InWords(needs.needs) + "\n") != std::string::npos);
    CHECK(text.find("\n  left out: " + InWords(needs.left_out) + "\n") != std::string::npos);
    CHECK((needs.needs & needs.left_out) == 0);
    CHECK(loaded.scene.name == fs::path(path).stem());
  }
}

TEST_CASE("two seconds of each scene with a finger in it: finite, and slower than a fall") {
  for (const auto& [path, loaded] : Gallery()) {
    CAPTURE(path);
    const Scene& scene = loaded.scene;
    Settings settings;
    settings.features.radius_mm = 100;  // wherever things have rolled meanwhile
    WorldStep step(settings, scene, MakeDynamics(scene, 1e-3), 0);
    protocol::HapticTick tick;
    tick.tick = 1;
    tick.pointer_count = 1;
    tick.pointers[0].position = {-0.02, 0, 0};
    tick.pointers[0].radius = 0.01;
    step.BeginHapticEpoch(1);
    step.Consume(tick);
    protocol::WorldFrame frame;
    for (int i = 0; i < 40; ++i) {
      step.Tick(0.05, frame);
      for (std::uint32_t j = 0; j < frame.plane_count; ++j) {
        REQUIRE(ToVec3(frame.planes[j].point).allFinite());
        REQUIRE(ToVec3(frame.planes[j].normal).norm() == Approx(1).epsilon(1e-9));
      }
      for (const protocol::Body& body : step.Bodies()) {
        REQUIRE(ToVec3(body.position).allFinite());
        REQUIRE(ToVec3(body.velocity).norm() < 2);  // 20 cm of fall
        REQUIRE(ToVec3(body.position).z() > -0.2);
      }
    }
    CHECK(frame.plane_count > 0);
  }
}

}  // namespace rikiseki::world
