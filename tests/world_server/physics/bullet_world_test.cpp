// SPDX-License-Identifier: MIT
#include "world_server/physics/bullet_world.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <random>
#include <stdexcept>

#include "tests/world_server/scenes.h"

namespace rikiseki::world {
namespace {

using test::Cube;
using test::CubeOnFloor;
using test::Floor;
using test::FreeCube;

constexpr double kSubstep = 1e-3;
constexpr double kGravity = 9.81;
// Bodies sink into each other by 1e-4 of their diameter; the solver settles within as much again.
constexpr double kSlop = 1e-4;

void Run(BulletWorld& world, double seconds) {
  const int periods = static_cast<int>(std::lround(seconds / 0.05));
  for (int i = 0; i < periods; ++i) world.ApplyAndStep({}, 0.05);
}

void Push(BulletWorld& world, std::size_t body, const Vec3& impulse,
          const Vec3& angular_impulse = Vec3::Zero()) {
  const Kick kick{.body = body, .impulse = impulse, .angular_impulse = angular_impulse};
  world.ApplyAndStep({&kick, 1}, 0);
}

Mat3 AnyInertia() {
  const Mat3 axes = Quat(0.5, 0.1, -0.7, 0.3).normalized().toRotationMatrix();
  return axes * Vec3(0.010, 0.007, 0.004).asDiagonal() * axes.transpose();
}

}  // namespace

TEST_CASE("free fall is exact") {
  Scene scene = FreeCube(1);
  scene.gravity = {0, 0, -kGravity};
  BulletWorld world(scene, kSubstep);
  Run(world, 1);
  CHECK(world.State(0).velocity.z() == Approx(-kGravity).epsilon(1e-12));
  CHECK(world.State(0).pose.position.z() == Approx(-kGravity / 2).epsilon(1e-12));
}

TEST_CASE("a kick changes the velocity by exactly J/m and I^-1 L") {
  Scene scene = FreeCube(0.7);
  scene.bodies[0].inertia = AnyInertia();
  scene.bodies[0].pose_WB.orientation = Quat(0.2, -0.4, 0.1, 0.9).normalized();
  BulletWorld world(scene, kSubstep);
  const Vec3 impulse(0.3, -0.1, 0.05);
  const Vec3 angular(0.002, 0.001, -0.003);
  Push(world, 0, impulse, angular);
  const Mat3 axes = scene.bodies[0].pose_WB.orientation.toRotationMatrix();
  const Vec3 spin = axes * AnyInertia().inverse() * axes.transpose() * angular;
  CHECK((world.State(0).velocity - impulse / 0.7).norm() < 1e-15);
  CHECK((world.State(0).angular_velocity - spin).norm() < 1e-12 * spin.norm());
  CHECK((world.State(0).pose.position).norm() == 0);
  CHECK(world.State(0).pose.orientation.angularDistance(scene.bodies[0].pose_WB.orientation) <
        1e-12);
}

TEST_CASE("a free cube keeps energy and momentum, and turns as it should") {
  BulletWorld world(FreeCube(0.5), kSubstep);
  const double inertia = 0.5 * 0.06 * 0.06 / 6;
  const Vec3 spin = Vec3(3, -5, 8);
  Push(world, 0, {0.1, 0.2, -0.05}, inertia * spin);
  Run(world, 2);
  const BodyState state = world.State(0);
  CHECK((state.velocity - Vec3(0.2, 0.4, -0.1)).norm() < 1e-15);
  CHECK((state.angular_velocity - spin).norm() < 1e-12);
  CHECK((state.pose.position - 2 * Vec3(0.2, 0.4, -0.1)).norm() < 1e-12);
  const Quat turned(Eigen::AngleAxisd(2 * spin.norm(), spin.normalized()));
  CHECK(state.pose.orientation.angularDistance(turned) < 1e-9);
}

TEST_CASE("a body with unequal moments spins steadily about its largest axis") {
  Scene scene = FreeCube(1);
  scene.bodies[0].inertia = Vec3(0.010, 0.007, 0.004).asDiagonal();
  BulletWorld world(scene, kSubstep);
  Push(world, 0, Vec3::Zero(), {0.1, 0, 0});
  Run(world, 2);
  CHECK((world.State(0).angular_velocity - Vec3(10, 0, 0)).norm() < 1e-9);
}

TEST_CASE("a sliding cube stops after v^2 / (2 mu g), in every direction, for every step") {
  for (const double substep : {1e-3, 5e-3, 10e-3}) {
    for (const double angle : {0.0, 0.4, 0.785398163397448}) {
      BulletWorld world(CubeOnFloor(0.5), substep);
      Run(world, 1);
      const Vec3 start = world.State(1).pose.position;
      Push(world, 1, 2 * Vec3(std::cos(angle), std::sin(angle), 0));
      Run(world, 1.5);
      const Vec3 way = world.State(1).pose.position - start;
      const double exact = 4 / (2 * 0.5 * kGravity);
      CAPTURE(substep, angle);
      // The substep in which it stops is not moved at all: mu g h^2 / 2 at most.
      const double short_by = 0.5 * kGravity * substep * substep / 2;
      CHECK(way.head<2>().norm() < exact + 1e-6);
      CHECK(way.head<2>().norm() > exact - short_by - 1e-6);
      CHECK(std::abs(way.y() * std::cos(angle) - way.x() * std::sin(angle)) < 1e-6);
      CHECK(world.State(1).velocity.norm() < 1e-9);
    }
  }
}

TEST_CASE("friction of two surfaces combines as sqrt(mu1 mu2)") {
  Scene scene = CubeOnFloor(0.9);
  scene.bodies[1].colliders[0].friction = 0.1;  // combined 0.3
  BulletWorld world(scene, kSubstep);
  Run(world, 0.5);
  Push(world, 1, {1, 0, 0});
  Run(world, 0.1);
  CHECK(world.State(1).velocity.x() == Approx(1 - 0.3 * kGravity * 0.1).epsilon(1e-4));
}

TEST_CASE("a resting cube neither sinks beyond the slop nor creeps, and a push wakes it") {
  BulletWorld world(CubeOnFloor(0.3), kSubstep);
  Run(world, 1);
  const Pose start = world.State(1).pose;
  CHECK(std::abs(start.position.z() - 0.03) <= 2 * kSlop * 0.06 * std::sqrt(3));
  Run(world, 10);
  CHECK((world.State(1).pose.position - start.position).norm() < 1e-9);
  CHECK(world.State(1).pose.orientation.angularDistance(start.orientation) < 1e-9);
  Push(world, 1, {0.5, 0, 0});
  Run(world, 0.05);
  CHECK(world.State(1).pose.position.x() > start.position.x() + 0.015);
}

TEST_CASE("a push below stiction does not move a cube") {
  BulletWorld world(CubeOnFloor(0.3), kSubstep);
  Run(world, 1);
  const Vec3 start = world.State(1).pose.position;
  // 2 N for 2 s at the foot of 2.94 N of friction, as kicks of every substep.
  for (int i = 0; i < 2000; ++i) {
    const Kick kick{.body = 1, .impulse = {2 * kSubstep, 0, 0}};
    world.ApplyAndStep({&kick, 1}, kSubstep);
  }
  CHECK((world.State(1).pose.position - start).norm() < 1e-6);
}

TEST_CASE("every shape comes to rest on the floor at its own height") {
  struct Row {
    Shape shape;
    double height;
  };
  const std::vector<Row> rows = {{Box{{0.03, 0.04, 0.02}}, 0.02},
                                 {Sphere{0.03}, 0.03},
                                 {Cylinder{0.03, 0.02}, 0.02},
                                 {Ellipsoid{{0.04, 0.04, 0.02}}, 0.02},
                                 {Capsule{0.02, 0}, 0.02}};
  for (const Row& row : rows) {
    Scene scene = CubeOnFloor(0.5);
    scene.bodies[1].colliders[0].shape = row.shape;
    scene.bodies[1].pose_WB.position.z() = row.height + 1e-3;
    BulletWorld world(scene, kSubstep);
    Run(world, 3);
    CAPTURE(row.shape.index());
    CHECK(world.State(1).pose.position.z() == Approx(row.height).margin(5e-5));
  }
}

TEST_CASE("a body of several shapes off its centre of mass stands on its feet") {
  Scene scene = CubeOnFloor(0.5);
  SceneBody& table = scene.bodies[1];
  table.colliders.clear();
  for (const double x : {-0.05, 0.05}) {
    for (const double y : {-0.05, 0.05}) {
      Collider foot{.shape = Box{{0.005, 0.005, 0.02}}, .friction = 0.5};
      foot.pose_BS.position = {x, y, -0.03};
      table.colliders.push_back(foot);
    }
  }
  table.inertia = AnyInertia();  // axes of inertia that are not the body's
  table.pose_WB.position.z() = 0.0505;
  BulletWorld world(scene, kSubstep);
  Run(world, 3);
  CHECK(world.State(1).pose.position.z() == Approx(0.05).margin(5e-5));
  CHECK(world.State(1).pose.orientation.angularDistance(Quat::Identity()) < 1e-3);
}

TEST_CASE("a stack of five cubes stands") {
  Scene scene;
  scene.bodies.push_back(Floor(0.5));
  for (int i = 0; i < 5; ++i)
    scene.bodies.push_back(Cube(0.05, 0.2, 0.5, {0, 0, 0.025 + 0.05 * i}));
  BulletWorld world(scene, kSubstep);
  Run(world, 3);
  CHECK((world.State(5).pose.position - Vec3(0, 0, 0.225)).norm() < 1e-3);
}

// Bullet's own routine would see the pair only in the overlap, half a millimetre deep.
TEST_CASE("a cube that hits another does not enter it, and shares its momentum with it") {
  for (const double other_kg : {0.05, 0.5, 5.0}) {
    Scene scene = FreeCube(0.5);
    scene.bodies.push_back(test::Cube(0.06, other_kg, 0.3, Vec3(0.0702, 0, 0)));
    BulletWorld world(scene, kSubstep);
    const Kick kick{.body = 0, .impulse = Vec3(0.5 * 0.6, 0, 0)};  // 0.6 m/s over a gap of 10.2 mm
    world.ApplyAndStep({&kick, 1}, kSubstep);
    for (int i = 1; i < 30; ++i) {
      world.ApplyAndStep({}, kSubstep);
      const double gap = world.State(1).pose.position.x() - world.State(0).pose.position.x() - 0.06;
      CAPTURE(other_kg, i);
      CHECK(gap > -1.05e-5);  // 10.4 um: the depth at which bodies rest in each other
    }
    const double shared = 0.5 * 0.6 / (0.5 + other_kg);
    CHECK(world.State(0).velocity.x() == Approx(shared).epsilon(1e-3));
    CHECK(world.State(1).velocity.x() == Approx(shared).epsilon(1e-3));
  }
}

TEST_CASE("a plane may lean, and a cube slides down it") {
  Scene scene = CubeOnFloor(0.3);
  const Quat lean(Eigen::AngleAxisd(0.5, Vec3::UnitY()));
  scene.bodies[0].colliders[0].pose_BS.orientation = lean;
  scene.bodies[1].pose_WB = {lean * Vec3(0, 0, 0.03), lean};
  BulletWorld world(scene, kSubstep);
  Run(world, 0.5);
  const double speed = kGravity * (std::sin(0.5) - 0.3 * std::cos(0.5)) * 0.5;
  CHECK((world.State(1).velocity - lean * Vec3(speed, 0, 0)).norm() < 0.01 * speed);
}

TEST_CASE("the same calls give the same bits") {
  const auto run = [] {
    Scene scene = CubeOnFloor(0.4);
    scene.bodies.push_back(Cube(0.05, 0.3, 0.2, {0.1, 0, 0.1}));
    scene.bodies.push_back(Cube(0.04, 0.1, 0.9, {0.12, 0.01, 0.2}));
    BulletWorld world(scene, kSubstep);
    std::mt19937 random(5);
    std::uniform_real_distribution<double> uniform(-0.1, 0.1);
    for (int i = 0; i < 40; ++i) {
      const Kick kick{.body = 1 + i % 3UL,
                      .impulse = {uniform(random), uniform(random), uniform(random)},
                      .angular_impulse = 0.01 * Vec3(uniform(random), uniform(random), 0)};
      world.ApplyAndStep({&kick, 1}, 0.05);
    }
    std::vector<double> bits;
    for (std::size_t body = 1; body < 4; ++body) {
      const BodyState state = world.State(body);
      for (const double v : state.pose.position) bits.push_back(v);
      for (const double v : state.pose.orientation.coeffs()) bits.push_back(v);
      for (const double v : state.velocity) bits.push_back(v);
    }
    return bits;
  };
  const std::vector<double> first = run();
  const std::vector<double> second = run();
  REQUIRE(first.size() == second.size());
  CHECK(std::memcmp(first.data(), second.data(), first.size() * sizeof(double)) == 0);
}

TEST_CASE("a scene in which nothing moves builds no engine") {
  Scene scene;
  scene.bodies = {Floor(0.3), Floor(0.5)};
  BulletWorld world(scene, kSubstep);
  CHECK_FALSE(world.simulates());
  Push(world, 0, {1, 0, 0});
  Run(world, 1);
  CHECK(world.body_count() == 2);
  CHECK(world.State(1).velocity == Vec3::Zero());
  CHECK(BulletWorld(CubeOnFloor(0.3), kSubstep).simulates());
}

TEST_CASE("what the engine cannot take is refused") {
  const auto refused = [](const auto& change) {
    Scene scene = CubeOnFloor(0.3);
    change(scene.bodies[1]);
    CHECK_THROWS_AS(BulletWorld(scene, kSubstep), std::invalid_argument);
  };
  refused([](SceneBody& body) { body.mass_kg = 0; });
  refused([](SceneBody& body) { body.inertia(2, 2) = 0; });
  refused([](SceneBody& body) { body.colliders.clear(); });
  refused([](SceneBody& body) { body.colliders[0].shape = HalfSpace{}; });
  refused([](SceneBody& body) {
    body.colliders.push_back(body.colliders[0]);
    body.colliders[1].friction = 0.9;
  });
  CHECK_THROWS_AS(BulletWorld(CubeOnFloor(0.3), 0), std::invalid_argument);
}

}  // namespace rikiseki::world
