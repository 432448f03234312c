// SPDX-License-Identifier: MIT
#include <catch2/catch.hpp>
#include <cmath>

#include "tests/world_server/scenes.h"
#include "world_server/physics/bullet_world.h"

namespace rikiseki::world {
namespace {

constexpr double kGravity = 9.81;

void Push(BulletWorld& world, std::size_t body, const Vec3& impulse, const Vec3& angular_impulse) {
  const Kick kick{.body = body, .impulse = impulse, .angular_impulse = angular_impulse};
  world.ApplyAndStep({&kick, 1}, 0);
}

}  // namespace

TEST_CASE("free fall and the flight after a kick are exact at 10 ms") {
  Scene scene = test::FreeCube(0.4);
  scene.gravity = {0, 0, -kGravity};
  BulletWorld world(scene, 0.01);
  const Vec3 v0(0.5, -0.2, 1);
  Push(world, 0, 0.4 * v0, Vec3::Zero());
  for (int i = 1; i <= 100; ++i) {
    world.ApplyAndStep({}, 0.01);
    const double t = 0.01 * i;
    const Vec3 exact = t * v0 - Vec3(0, 0, kGravity / 2 * t * t);
    REQUIRE((world.State(0).pose.position - exact).norm() < 1e-12);
  }
}

TEST_CASE("a sliding cube stops where it should, along an edge and across") {
  // Short by mu g h^2 / 2 at most, the substep in which it stops: 0.15 mm at 10 ms, 1.5 um at 1 ms.
  const double friction = 0.3;
  const double speed = 1;
  for (const double substep : {0.01, 0.001}) {
    const double tolerance = friction * kGravity * substep * substep / 2 + 5e-7;
    for (const double degrees : {0.0, 45.0}) {
      Scene scene = test::CubeOnFloor(friction, 0.06, 0.5);
      scene.bodies[1].pose_WB.position.z() -= 1e-4 * 0.06 * std::sqrt(3);  // resting depth
      BulletWorld world(scene, substep);
      const double angle = degrees * M_PI / 180;
      const Vec3 along(std::cos(angle), std::sin(angle), 0);
      Push(world, 1, 0.5 * speed * along, Vec3::Zero());
      for (int i = 0; i < 60; ++i) world.ApplyAndStep({}, 0.01);
      const Vec3 slid = world.State(1).pose.position - scene.bodies[1].pose_WB.position;
      CAPTURE(substep, degrees, slid.transpose());
      CHECK(world.State(1).velocity.norm() < 1e-6);
      CHECK(std::abs(slid.dot(along) - speed * speed / (2 * friction * kGravity)) < tolerance);
      CHECK(std::abs(slid.cross(along).z()) < tolerance);
    }
  }
}

TEST_CASE("a tumbling plate keeps angular momentum and energy at 10 ms") {
  Scene scene = test::FreeCube(0.4);
  const Mat3 inertia = 0.4 / 3 * Vec3(0.0026, 0.0101, 0.0125).asDiagonal();
  scene.bodies[0].inertia = inertia;
  scene.bodies[0].colliders[0].shape = Box{{0.1, 0.05, 0.01}};
  BulletWorld world(scene, 0.01);
  const Vec3 kick = inertia * Vec3(2, 3, 1);
  Push(world, 0, Vec3::Zero(), kick);
  const double energy = kick.dot(Vec3(2, 3, 1));
  for (int i = 0; i < 500; ++i) {
    world.ApplyAndStep({}, 0.01);
    const BodyState state = world.State(0);
    const Mat3 axes = state.pose.orientation.toRotationMatrix();
    const Vec3 momentum = axes * inertia * axes.transpose() * state.angular_velocity;
    REQUIRE((momentum - kick).norm() < 1e-10 * kick.norm());
    REQUIRE(state.angular_velocity.dot(momentum) == Approx(energy).epsilon(1e-4));
  }
}

TEST_CASE("a push below stiction does not creep, whatever the substep") {
  for (const double substep : {0.001, 0.01}) {
    BulletWorld world(test::CubeOnFloor(0.3, 0.06, 1), substep);
    for (int i = 0; i < 50; ++i) world.ApplyAndStep({}, 0.01);
    const Vec3 before = world.State(1).pose.position;
    for (int i = 0; i < 500; ++i) {
      for (double t = 0; t < 0.0099; t += substep) {
        const Kick kick{.body = 1, .impulse = {1 * substep, 0, 0}};
        world.ApplyAndStep({&kick, 1}, substep);
      }
    }
    CHECK((world.State(1).pose.position - before).norm() < 1e-6);
  }
}

}  // namespace rikiseki::world
