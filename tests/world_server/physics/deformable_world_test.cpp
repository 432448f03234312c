// SPDX-License-Identifier: MIT
// Soft bodies behind the interface of the dynamics: pushes arrive once, and in order.
#include "world_server/physics/deformable_world.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "tests/world_server/scenes.h"
#include "world_server/features/nearest_point.h"
#include "world_server/scene/soft_mesh.h"

namespace rikiseki::world {
namespace {

Scene BlockAndCube() {
  Scene scene = test::CubeOnFloor(0.3);
  SceneBody block = test::Cube(0.06, 0.2, 0.5, {0.2, 0, 0.03});
  block.name = "block::link";
  block.pose_WB.orientation = Quat(Eigen::AngleAxisd(0.3, Vec3::UnitZ()));
  block.softness = Softness{.youngs_modulus_pa = 2e4, .element_m = 0.015};
  scene.bodies.push_back(block);
  return scene;
}

// The surface's nearest point to one above the block, as the finger would be told.
double Dent(const DynamicsWorld& world) {
  const Vec3 above(0, 0, 0.04);
  return (world.FindSoft(2)->WithoutDisplacement(above) - above).z();
}

Kick Press(double impulse_ns) {
  return {.body = 2, .impulse = {0, 0, -impulse_ns}};
}

}  // namespace

TEST_CASE("a scene gets the dynamics it needs") {
  const Scene with = BlockAndCube();
  Scene without = with;
  without.bodies.pop_back();
  CHECK(dynamic_cast<DeformableWorld*>(MakeDynamics(with, 1e-3).get()) != nullptr);
  CHECK(dynamic_cast<DeformableWorld*>(MakeDynamics(without, 1e-3).get()) == nullptr);
  const auto world = MakeDynamics(with, 1e-3);
  CHECK(world->body_count() == 3);
  CHECK(world->FindSoft(0) == nullptr);
  CHECK(world->FindSoft(1) == nullptr);
  REQUIRE(world->FindSoft(2) != nullptr);
  CHECK(world->State(2).pose.position == with.bodies[2].pose_WB.position);
  std::vector<ContactSite> sites;
  CHECK_FALSE(world->FindContacts(2, 0.01, sites));
  CHECK(sites.empty());
}

TEST_CASE("rigid bodies beside a soft one move as without it, to the bit") {
  const Scene with = BlockAndCube();
  Scene without = with;
  without.bodies.pop_back();
  const auto a = MakeDynamics(with, 1e-3), b = MakeDynamics(without, 1e-3);
  const std::vector<Kick> both = {{.body = 1, .impulse = {0.3, 0.1, 0}}, Press(0.1)};
  const std::vector<Kick> one = {both[0]};
  for (int i = 0; i < 20; ++i) {
    a->ApplyAndStep(i == 0 ? both : std::vector<Kick>{}, 0.01);
    b->ApplyAndStep(i == 0 ? one : std::vector<Kick>{}, 0.01);
    REQUIRE(a->State(1).pose.position == b->State(1).pose.position);
    REQUIRE(a->State(1).velocity == b->State(1).velocity);
  }
}

TEST_CASE("a steady force dents alike, however it is cut into kicks") {
  const Scene scene = BlockAndCube();
  std::vector<double> dents;
  for (const double period_s : {0.001, 0.007, 0.01, 1.0 / 60, 0.05, 0.1}) {
    const auto world = MakeDynamics(scene, 0.01);
    for (int i = 0; i < std::lround(1 / period_s); ++i) {
      const Kick press = Press(1.0 * period_s);  // 1 N
      world->ApplyAndStep({&press, 1}, period_s);
    }
    dents.push_back(Dent(*world));
  }
  CHECK(dents[0] > 1e-3);
  for (const double dent : dents) CHECK(dent == Approx(dents[0]).epsilon(1e-3));
}

TEST_CASE("it comes back when it is let go, and goes to sleep in its old shape") {
  const auto world = MakeDynamics(BlockAndCube(), 0.01);
  const Kick press = Press(0.1);
  for (int i = 0; i < 5; ++i) world->ApplyAndStep({&press, 1}, 0.05);
  CHECK(Dent(*world) > 1e-3);
  for (int i = 0; i < 40; ++i) world->ApplyAndStep({}, 0.05);
  CHECK(std::abs(Dent(*world)) < 2e-6);
}

TEST_CASE("the same scene and the same kicks give the same bits, and hostile ones do nothing") {
  const auto run = [](bool hostile) {
    const auto world = MakeDynamics(BlockAndCube(), 0.01);
    for (int i = 0; i < 30; ++i) {
      std::vector<Kick> kicks = {Press(0.02 * std::sin(i))};
      if (hostile) kicks.push_back({.body = 2, .impulse = {NAN, 0, 0}});
      if (hostile) kicks.push_back({.body = 2, .angular_impulse = {0, INFINITY, 0}});
      world->ApplyAndStep(kicks, 0.013);
    }
    return world->FindSoft(2)->WithoutDisplacement({0.01, 0, 0.04});
  };
  const Vec3 once = run(false);
  CHECK(once == run(false));
  CHECK(once == run(true));
  CHECK(once.z() != 0.04);
}

TEST_CASE("what nothing holds, and what would collapse, is not simulated") {
  Scene scene = BlockAndCube();
  CHECK(WhyNotSoft(scene, scene.bodies[2]).empty());
  SceneBody& block = scene.bodies[2];
  block.pose_WB.position.z() = 0.031;
  CHECK(WhyNotSoft(scene, block).find("nothing holds it") == 0);
  block.pose_WB.position.z() = 0.03;
  block.pose_WB.orientation = Quat(Eigen::AngleAxisd(0.1, Vec3::UnitX()));  // stands on an edge
  block.pose_WB.position.z() = 0.03 * (std::cos(0.1) + std::sin(0.1));
  CHECK(WhyNotSoft(scene, block).find("nothing holds it") == 0);
  scene = BlockAndCube();
  scene.bodies[2].softness->youngs_modulus_pa = 200;
  CHECK(WhyNotSoft(scene, scene.bodies[2]).find("it would collapse") == 0);
  scene.bodies[2].falls = false;
  CHECK(WhyNotSoft(scene, scene.bodies[2]).empty());
  scene.bodies[2].pose_WB.position.z() = -0.5;
  CHECK(WhyNotSoft(scene, scene.bodies[2]).find("it lies within fixed bodies") == 0);
}

}  // namespace rikiseki::world
