// SPDX-License-Identifier: MIT
// Worlds as Gazebo's tutorials have people write them load, say what of them is not done, and run.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "world_server/physics/bullet_world.h"
#include "world_server/scene/sdf_loader.h"

namespace rikiseki::world {
namespace {

LoadedScene Load(const std::string& name) {
  return LoadSdf(std::string(RIKISEKI_SOURCE_DIR) + "/tests/data/worlds/" + name);
}

std::size_t Find(const Scene& scene, const std::string& name) {
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
    if (scene.bodies[i].name == name) return i;
  }
  FAIL("no body " << name);
  return 0;
}

bool Says(const LoadedScene& loaded, const std::string& part) {
  return std::any_of(loaded.warnings.begin(), loaded.warnings.end(),
                     [&](const std::string& w) { return w.find(part) != std::string::npos; });
}

void Run(BulletWorld& world, double seconds) {
  for (int i = 0; i < std::lround(seconds / 0.05); ++i) world.ApplyAndStep({}, 0.05);
}

}  // namespace

TEST_CASE("a vehicle on two wheels and a caster stands, and rolls where it is pushed") {
  const LoadedScene loaded = Load("vehicle.sdf");
  CHECK(Says(loaded, "vehicle.sdf:4: <physics>"));
  CHECK(Says(loaded, "vehicle.sdf:8: <plugin>"));
  CHECK(Says(loaded, "<mu2> differs from <mu>"));
  const Scene& scene = loaded.scene;
  CHECK(scene.joints.size() == 3);
  const std::size_t chassis = Find(scene, "rover::chassis");
  const std::size_t wheel = Find(scene, "rover::left_wheel");
  BulletWorld world(scene, 1e-3);
  Run(world, 0.5);
  CHECK((world.State(chassis).pose.position - Vec3(0, 0, 0.15)).norm() < 1e-3);
  const Kick kick{.body = chassis, .impulse = {1, 0, 0}};
  world.ApplyAndStep({&kick, 1}, 0);
  Run(world, 0.5);
  const double speed = world.State(chassis).velocity.x();
  CHECK(speed > 0.1);
  CHECK(speed < 1 / 6.0);  // the wheels take their share
  // They roll; on cylinders of 32 corners, if not evenly.
  CHECK(world.State(wheel).angular_velocity.y() == Approx(speed / 0.1).epsilon(0.05));
  CHECK(std::abs(world.State(chassis).pose.position.z() - 0.15) < 1e-3);
}

TEST_CASE("a double pendulum on a post that is fixed to the world swings and keeps its energy") {
  const LoadedScene loaded = Load("pendulum.world");
  CHECK(Says(loaded, "<velocity_decay> means another thing in each engine"));
  const Scene& scene = loaded.scene;
  const std::size_t upper = Find(scene, "double_pendulum::upper_link");
  const std::size_t lower = Find(scene, "double_pendulum::lower_link");
  CHECK(scene.bodies[Find(scene, "double_pendulum::base")].fixed);
  REQUIRE(scene.joints.size() == 2);
  BulletWorld world(scene, 1e-3);
  const auto energy = [&] {
    double sum = 0;
    for (const std::size_t body : {upper, lower}) {
      const BodyState state = world.State(body);
      const Vec3 spin = state.pose.orientation.conjugate() * state.angular_velocity;
      sum += scene.bodies[body].mass_kg *
                 (state.velocity.squaredNorm() / 2 - scene.gravity.dot(state.pose.position)) +
             spin.dot(scene.bodies[body].inertia * spin) / 2;
    }
    return sum;
  };
  const double start = energy();
  double lowest = 2;
  for (int i = 0; i < 60; ++i) {
    Run(world, 0.05);
    lowest = std::min(lowest, world.State(lower).pose.position.z());
    CHECK(energy() == Approx(start).margin(0.01));  // J; it swings by 10
  }
  CHECK(lowest < 1.5);
}

TEST_CASE("crates with hinged lids, included, nested and stacked, stand where they were put") {
  const LoadedScene loaded = Load("crates.sdf");
  const Scene& scene = loaded.scene;
  REQUIRE(scene.joints.size() == 3);
  const std::size_t glued = Find(scene, "pair::tray");
  // The lid and the tray on it are one body, whichever stands first in the file.
  CHECK(scene.bodies[glued].mass_kg == Approx(0.8));
  CHECK(scene.bodies[glued].colliders.size() == 2);
  BulletWorld world(scene, 1e-3);
  Run(world, 1);
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
    CAPTURE(scene.bodies[i].name);
    CHECK((world.State(i).pose.position - scene.bodies[i].pose_WB.position).norm() < 2e-3);
  }
}

}  // namespace rikiseki::world
