// SPDX-License-Identifier: MIT
#include "world_server/physics/sleep.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "tests/world_server/scenes.h"
#include "world_server/physics/bullet_world.h"

namespace rikiseki::world {
namespace {

using test::Cube;
using test::CubeOnFloor;
using test::Floor;
using test::FreeCube;

void Play(BulletWorld& world, double seconds) {
  const Stretch period{.length_s = 0.05};
  const int periods = static_cast<int>(std::lround(seconds / 0.05));
  for (int i = 0; i < periods; ++i) world.Play({&period, 1});
}

void Throw(BulletWorld& world, std::size_t body, const Vec3& impulse) {
  const Kick kick{.body = body, .impulse = impulse};
  world.ApplyAndStep({&kick, 1}, 0);
}

Scene CubesApart(int count, double friction = 0.5) {
  Scene scene;
  scene.bodies.push_back(Floor(friction));
  for (int i = 0; i < count; ++i) {
    scene.bodies.push_back(Cube(0.02, 0.02, friction, {0.1 * i, 0, 0.01}));
  }
  return scene;
}

bool SamePlace(const BodyState& a, const BodyState& b) {
  return a.pose.position == b.pose.position &&
         a.pose.orientation.coeffs() == b.pose.orientation.coeffs();
}

}  // namespace

TEST_CASE("what rests falls asleep within two seconds, costs nothing and stays to the bit") {
  Scene scene = CubesApart(3);
  for (int i = 0; i < 4; ++i)
    scene.bodies.push_back(Cube(0.05, 0.1, 0.5, {0, 0.3, 0.025 + 0.05 * i}));
  BulletWorld world(scene, 1e-3);
  CHECK(world.awake() == 7);
  Play(world, 2);
  REQUIRE(world.awake() == 0);
  std::vector<BodyState> before;
  for (std::size_t i = 0; i < world.body_count(); ++i) before.push_back(world.State(i));
  const std::uint64_t substeps = world.substeps();
  Play(world, 10);
  CHECK(world.substeps() == substeps);
  for (std::size_t i = 0; i < world.body_count(); ++i) {
    CHECK(SamePlace(world.State(i), before[i]));
    CHECK(world.State(i).velocity == Vec3::Zero());
  }
}

TEST_CASE("a scene that begins at rest sleeps before its first world period is over") {
  Scene scene = CubesApart(100);
  BulletWorld world(scene, 1e-3);
  Play(world, 0.05);
  CHECK(world.awake() == 0);
  // Each sinks by its resting depth, a ten thousandth of its diagonal: 3.5 um.
  for (std::size_t i = 1; i <= 100; ++i) {
    CHECK((world.State(i).pose.position - scene.bodies[i].pose_WB.position).norm() < 4e-6);
  }
}

TEST_CASE("what begins at rest and is about to roll, fall or tip does not fall asleep") {
  // On a slope of 1e-3 a ball rolls at 5/7 g 1e-3 = 7 mm/s^2.
  Scene slope;
  slope.gravity = {9.81e-3, 0, -9.81};
  slope.bodies = {Floor(0.5), Cube(0.02, 0.02, 0.5, {0, 0, 0.01})};
  slope.bodies[1].colliders[0].shape = Sphere{0.01};
  slope.bodies[1].inertia = Mat3::Identity() * (0.4 * 0.02 * 1e-4);
  BulletWorld rolling(slope, 1e-3);
  Play(rolling, 1);
  CHECK(rolling.State(1).pose.position.x() == Approx(9.81e-3 * 5 / 14).epsilon(1e-2));

  // Its middle 0.01 mm beyond the edge of what carries it.
  Scene edge;
  edge.bodies = {Floor(0.5), Cube(0.02, 0.02, 0.5, {0.01001, 0, 0.03})};
  edge.bodies.push_back(Cube(0.02, 1, 0.5, {-0.01, 0, 0.01}));
  edge.bodies.back().name = "table::link";
  edge.bodies.back().fixed = true;
  edge.bodies.back().colliders[0].shape = Box{{0.02, 0.02, 0.01}};
  BulletWorld tipping(edge, 1e-3);
  Play(tipping, 2);
  CHECK(tipping.State(1).pose.position.z() < 0.02);
}

TEST_CASE("a push wakes those that it reaches and no others") {
  Scene scene = CubesApart(3);
  scene.bodies.push_back(Cube(0.02, 0.02, 0.5, {0, 0, 0.03}));  // on the first
  BulletWorld world(scene, 1e-3);
  Play(world, 2);
  REQUIRE(world.awake() == 0);
  const BodyState far = world.State(3);
  const PlacedImpulse push{.body = 1, .impulse = {0.002, 0, 0}};
  const Stretch period{.length_s = 0.05, .pushes = {&push, 1}};
  world.Play({&period, 1});
  CHECK(world.awake() == 2);
  CHECK(world.State(1).pose.position.x() > 1e-4);
  CHECK(SamePlace(world.State(3), far));
}

TEST_CASE("a sleeper that is hit wakes before it is entered, and takes its share of the momentum") {
  for (const double speed : {0.2, 1.0, 5.0}) {
    const auto run = [speed](bool sleeping) {
      Scene scene = CubesApart(2, 0);  // no friction: momentum along x stays
      EngineParts parts = EngineParts::Of(scene);
      parts.sleeping = sleeping;
      BulletWorld world(scene, 1e-3, parts);
      Play(world, 1);
      CHECK(world.awake() == (sleeping ? 0 : 2));
      Throw(world, 1, {0.02 * speed, 0, 0});
      double least = 1;
      for (int i = 0; i < 60; ++i) {
        const Stretch tick{.length_s = 0.01};
        world.Play({&tick, 1});
        least =
            std::min(least, world.State(2).pose.position.x() - world.State(1).pose.position.x());
      }
      CAPTURE(speed, sleeping);
      CHECK(least > 0.02 - 1e-5);
      CHECK(world.State(1).velocity.x() + world.State(2).velocity.x() ==
            Approx(speed).epsilon(1e-9));
      return world.State(2).velocity.x();
    };
    CHECK(run(true) == Approx(run(false)).epsilon(1e-6));
  }
}

TEST_CASE("0.1 mm/s is a motion and no rest, and so is anything that floats") {
  Scene scene = CubesApart(2, 0);
  BulletWorld world(scene, 1e-3);
  Play(world, 1);
  Throw(world, 1, {0.02 * 1e-4, 0, 0});
  Play(world, 5);
  CHECK(world.awake() == 1);
  CHECK(world.State(1).pose.position.x() == Approx(5e-4).epsilon(1e-3));

  BulletWorld floating(FreeCube(1), 1e-3);
  Throw(floating, 0, {1e-7, 0, 0});
  Play(floating, 5);
  CHECK(floating.awake() == 1);
  CHECK(floating.State(0).pose.position.x() == Approx(5e-7).epsilon(1e-9));
}

TEST_CASE("a slow steady push moves a cube, and the sleeping one before it") {
  Scene scene = CubesApart(1, 0.3);
  scene.bodies.push_back(Cube(0.02, 0.02, 0.3, {0.0201, 0, 0.01}));
  BulletWorld world(scene, 1e-3);
  Play(world, 2);
  REQUIRE(world.awake() == 0);
  // A hand that holds 0.1 mm/s: gives every millisecond what is missing.
  std::vector<PlacedImpulse> pushes(50);
  std::vector<Stretch> period(50);
  for (int frame = 0; frame < 100; ++frame) {
    const BodyState state = world.State(1);
    // Friction of one or two cubes takes up to 2 * 0.3 m g dt in each tick.
    const double missing = 0.02 * (1e-4 - state.velocity.x());
    for (std::size_t i = 0; i < 50; ++i) {
      pushes[i] = {.body = 1, .impulse = {2.0 * 0.3 * 0.02 * 9.81 * 1e-3, 0, 0}};
      if (i == 0) pushes[i].impulse.x() += missing;
      pushes[i].angular_impulse = Vec3(0, 0, 0.01).cross(pushes[i].impulse);
      period[i] = {.length_s = 1e-3, .pushes = {&pushes[i], 1}};
    }
    world.Play(period);
  }
  CHECK(world.State(1).pose.position.x() > 1e-4);
  CHECK(world.State(2).pose.position.x() > 0.0201);
}

TEST_CASE("no energy appears while a heap falls, collapses and falls asleep") {
  Scene scene;
  scene.bodies.push_back(Floor(0.4));
  for (int i = 0; i < 12; ++i) {
    scene.bodies.push_back(
        Cube(0.03, 0.05, 0.4, {0.011 * (i % 3), 0.007 * (i % 2), 0.05 + 0.04 * i}));
  }
  BulletWorld world(scene, 1e-3);
  const auto energy = [&] {
    double sum = 0;
    for (std::size_t i = 1; i < world.body_count(); ++i) {
      const SceneBody& body = scene.bodies[i];
      const BodyState state = world.State(i);
      sum += body.mass_kg * (state.velocity.squaredNorm() / 2 + 9.81 * state.pose.position.z()) +
             body.inertia(0, 0) * state.angular_velocity.squaredNorm() / 2;
    }
    return sum;
  };
  double last = energy();
  const double first = last;
  for (int i = 0; i < 100; ++i) {
    Play(world, 0.05);
    const double now = energy();
    // Penetrations of a hit are mended by moving bodies out of each other, a fraction of a millimetre.
    REQUIRE(now < last + 12 * 0.05 * 9.81 * 2e-4);
    last = now;
  }
  CHECK(last < 0.5 * first);
  CHECK(world.awake() == 0);
}

}  // namespace rikiseki::world
