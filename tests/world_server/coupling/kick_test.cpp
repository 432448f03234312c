// SPDX-License-Identifier: MIT
#include "world_server/coupling/kick.h"

#include <catch2/catch.hpp>

#include "tests/world_server/scenes.h"

namespace rikiseki::world {
namespace {

std::vector<BodyState> StatesOf(const Scene& scene) {
  std::vector<BodyState> states;
  for (const SceneBody& body : scene.bodies) states.push_back({.pose = body.pose_WB});
  return states;
}

}  // namespace

TEST_CASE("an impulse about the world origin becomes one about the centre of mass") {
  // J at p has L = p x J about the origin; about c it must be (p - c) x J.
  const Vec3 p(0.1, -0.2, 0.3), c(1, 2, -3), j(0.5, 0.25, -1);
  const std::vector<BodyState> states = {{.pose = {.position = c}}};
  const std::vector<OwedPush> owed = {
      {.push = {.body = 0, .impulse = j, .angular_impulse = p.cross(j)}}};
  const std::vector<Kick> kicks = ImpulseKicks(owed, states);
  REQUIRE(kicks.size() == 1);
  CHECK(kicks[0].impulse == j);
  CHECK((kicks[0].angular_impulse - (p - c).cross(j)).norm() < 1e-14);
}

TEST_CASE("the penalty is k_p depth Tw against the normal, at the finger's surface point") {
  const Scene scene = test::CubeOnFloor(0.3);
  // The sphere's surface is 2 mm inside the face, and 10 mm above the cube's centre.
  const std::vector<Finger> fingers = {{.radius_m = 0.01, .position = {-0.038, 0, 0.04}}};
  const PenaltyLaw law{.stiffness_n_per_m = 2000, .period_s = 0.05, .largest_impulse_ns = 10};
  const std::vector<Kick> kicks = PenaltyKicks(scene, StatesOf(scene), fingers, law);
  REQUIRE(kicks.size() == 1);
  CHECK(kicks[0].body == 1);
  CHECK((kicks[0].impulse - Vec3(2000 * 0.002 * 0.05, 0, 0)).norm() < 1e-14);
  CHECK((kicks[0].angular_impulse - Vec3(-0.028, 0, 0.01).cross(kicks[0].impulse)).norm() < 1e-14);
}

TEST_CASE("the penalty uses the surface's own stiffness, and nothing makes it large or undefined") {
  Scene scene = test::CubeOnFloor(0.3);
  const std::vector<Finger> deep = {{.radius_m = 0.01, .position = {-0.02, 0, 0.03}}};  // 20 mm
  PenaltyLaw law{.stiffness_n_per_m = 100, .period_s = 0.05, .largest_impulse_ns = 0.3};
  CHECK(PenaltyKicks(scene, StatesOf(scene), deep, law)[0].impulse.x() == Approx(0.1));
  law.stiffness_n_per_m = 1e300;
  CHECK(PenaltyKicks(scene, StatesOf(scene), deep, law)[0].impulse.x() == Approx(0.3));
  law.stiffness_n_per_m = std::numeric_limits<double>::quiet_NaN();
  CHECK(PenaltyKicks(scene, StatesOf(scene), deep, law).empty());
  law.stiffness_n_per_m = -5;
  CHECK(PenaltyKicks(scene, StatesOf(scene), deep, law).empty());
  scene.bodies[1].colliders[0].stiffness_n_per_m = 50;
  CHECK(PenaltyKicks(scene, StatesOf(scene), deep, law)[0].impulse.x() == Approx(0.05));
}

TEST_CASE("a finger that touches nothing, or only what is fixed, pushes nothing") {
  const Scene scene = test::CubeOnFloor(0.3);
  const PenaltyLaw law{.stiffness_n_per_m = 2000, .period_s = 0.05, .largest_impulse_ns = 10};
  const std::vector<Finger> fingers = {{.radius_m = 0.01, .position = {-0.041, 0, 0.03}},
                                       {.pointer = 1, .position = {1, 0, -0.01}}};
  CHECK(PenaltyKicks(scene, StatesOf(scene), fingers, law).empty());
}

}  // namespace rikiseki::world
