// SPDX-License-Identifier: MIT
// What a scene does not need changes nothing: every feature, on but with nothing to do, gives the same
// bits as switched out, in both loops, with a hand that presses and strokes. numerics.md section 6.
#include <catch2/catch.hpp>

#include "tests/lab/feature_switches.h"
#include "tests/lab/push_script.h"
#include "tests/lab/touch_run.h"
#include "world_server/physics/bullet_world.h"
#include "world_server/scene/sdf_loader.h"

namespace rikiseki::lab {
namespace {

TouchResult Run(const world::Scene& scene, const FeatureSwitch::Change& change) {
  Touch touch = TouchOf(scene);
  change(touch);
  return RunTouch(touch);
}

// A wall whose normal is of unit length but for rounding: dividing by its length changes it.
world::Scene TiltedWall() {
  world::Scene scene = PushScene({});
  scene.bodies.resize(1);
  scene.bodies[0].fixed = true;
  double angle = 0;
  Vec3 normal;
  do {
    angle += 0.1;
    normal = Eigen::AngleAxisd(angle, Vec3(1, 2, 3).normalized()) * -Vec3::UnitX();
  } while (normal / normal.norm() == normal);
  scene.bodies[0].colliders[0].shape = world::HalfSpace{.normal = normal};
  return scene;
}

}  // namespace

TEST_CASE("a touch presses what it touches, and is repeatable to the bit") {
  const Touch touch = TouchOf(PushScene({}));
  CHECK(touch.place.isApprox(Vec3(-kCubeHalf, 0, kCubeHalf), 1e-9));
  CHECK(touch.normal.isApprox(-Vec3::UnitX()));
  const TouchResult once = RunTouch(touch);
  CHECK(once.largest_force_n > 1);
  CHECK(once.haptic_us.size() > 100);
  CHECK(once.world_us.size() == 18);
  CHECK(SameMotion(once, RunTouch(touch)));
}

TEST_CASE("left out is switched out, to the bit, where a block moves") {
  const world::Scene scene = PushScene({.mass_kg = 0.5});
  for (const FeatureSwitch& feature : FeatureSwitches()) {
    CAPTURE(feature.name);
    const TouchResult left_out = Run(scene, feature.left_out);
    CHECK(left_out.largest_force_n > 0.5);
    CHECK(SameMotion(left_out, Run(scene, feature.switched_out)));
    // ... and the feature can be told from nothing, where it acts.
    CHECK(SameMotion(left_out, Run(scene, feature.in)) != feature.changes_motion);
  }
}

TEST_CASE("left out is switched out, to the bit, at a wall that no axis is normal to") {
  const world::Scene scene = TiltedWall();
  for (const FeatureSwitch& feature : FeatureSwitches()) {
    CAPTURE(feature.name);
    const TouchResult left_out = Run(scene, feature.left_out);
    CHECK(left_out.largest_force_n > 0.5);
    CHECK(SameMotion(left_out, Run(scene, feature.switched_out)));
  }
}

// Joints, softness, surfaces with a stiffness of their own, and a place where the hand could not wait
// on the usual side.
TEST_CASE("left out is switched out, to the bit, in the scenes that ship") {
  for (const char* name : {"door.sdf", "peg_in_hole.sdf", "soft_block.sdf", "stiff_wall.sdf"}) {
    const world::Scene scene =
        world::LoadSdf(std::string(RIKISEKI_SOURCE_DIR "/config/scenes/") + name).scene;
    for (const FeatureSwitch& feature : FeatureSwitches()) {
      CAPTURE(name, feature.name);
      const TouchResult left_out = Run(scene, feature.left_out);
      CHECK(left_out.largest_force_n > 0.5);
      CHECK(SameMotion(left_out, Run(scene, feature.switched_out)));
    }
  }
}

TEST_CASE("a neighbour out of reach changes nothing of what is touched") {
  const world::Scene alone = PushScene({.mass_kg = 0.5});
  Touch touch = TouchOf(alone);
  const TouchResult without = RunTouch(touch);
  touch.scene = PushScene(
      {.script = PushScript::kNeighbour, .mass_kg = 0.5, .gap_m = 5, .neighbour_kg = 0.5});
  CHECK(SameMotion(without, RunTouch(touch)));
  touch.scene = PushScene(
      {.script = PushScript::kNeighbour, .mass_kg = 0.5, .gap_m = 0.001, .neighbour_kg = 0.5});
  CHECK_FALSE(SameMotion(without, RunTouch(touch)));
}

TEST_CASE("where nothing moves there is no engine") {
  CHECK_FALSE(world::BulletWorld(TiltedWall(), 1e-3).simulates());
}

}  // namespace rikiseki::lab
