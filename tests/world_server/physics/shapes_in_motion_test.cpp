// SPDX-License-Identifier: MIT
// Hulls, meshes, compound bodies, air and rebound in the engine: what the scene says happens.
#include <catch2/catch.hpp>
#include <cmath>

#include "tests/world_server/meshes.h"
#include "tests/world_server/scenes.h"
#include "world_server/geometry/convex_hull.h"
#include "world_server/physics/bullet_world.h"

namespace rikiseki::world {
namespace {

using test::Cube;
using test::CubeOnFloor;
using test::FreeCube;

constexpr double kSubstep = 1e-3;
constexpr double kGravity = 9.81;

void Run(BulletWorld& world, double seconds) {
  const int periods = static_cast<int>(std::lround(seconds / 0.01));
  for (int i = 0; i < periods; ++i) world.ApplyAndStep({}, 0.01);
}

Hull HullOf(const TriangleMesh& mesh) {
  return {.mesh = std::make_shared<const TriangleMesh>(ConvexHull(mesh.corners()))};
}

Mesh MeshOf(const test::RawMesh& raw) {
  return {.mesh = std::make_shared<const TriangleMesh>(raw.corners, raw.triangles)};
}

SceneBody Terrain(const test::RawMesh& raw) {
  SceneBody body = test::Floor(0.5);
  body.colliders[0].shape = MeshOf(raw);
  return body;
}

// A ball of 3 cm that starts with its lowest point `height` above the floor.
Scene BallAbove(double height, double restitution) {
  Scene scene = CubeOnFloor(0.5);
  scene.bodies[0].colliders[0].restitution = 1;
  scene.bodies[1].colliders[0].shape = Sphere{0.03};
  scene.bodies[1].colliders[0].restitution = restitution;
  scene.bodies[1].pose_WB.position.z() = 0.03 + height;
  return scene;
}

}  // namespace

TEST_CASE("a hull rests on a floor and on a mesh at its own height, without a margin") {
  const TriangleMesh box = test::Build(test::BoxMesh({0.03, 0.03, 0.02}));
  for (const bool on_mesh : {false, true}) {
    Scene scene = CubeOnFloor(0.5);
    if (on_mesh) scene.bodies[0] = Terrain(test::CornerMesh());  // its top is z = 0
    scene.bodies[1].colliders[0].shape = HullOf(box);
    scene.bodies[1].pose_WB.position = {0.15, 0, 0.021};
    BulletWorld world(scene, kSubstep);
    Run(world, 3);
    CAPTURE(on_mesh);
    // The default margin would hold it 40 mm above.
    CHECK(world.State(1).pose.position.z() == Approx(0.02).margin(5e-5));
    CHECK(world.State(1).velocity.norm() < 1e-3);
  }
}

TEST_CASE("balls and boxes stay on a mesh and in the corner of it") {
  for (const Shape& shape : {Shape(Sphere{0.03}), Shape(Box{{0.03, 0.03, 0.03}})}) {
    Scene scene = CubeOnFloor(0.5);
    scene.bodies[0] = Terrain(
        test::Prism({{0, 0}, {0, 0.2}, {-0.1, 0.2}, {-0.1, -0.1}, {0.3, -0.1}, {0.3, 0}}, 0.2));
    scene.bodies[1].colliders[0].shape = shape;
    scene.bodies[1].pose_WB.position = {0.06, 0, 0.03};
    BulletWorld world(scene, kSubstep);
    const Kick kick{.body = 1, .impulse = {-1.5, 0, 0}};
    world.ApplyAndStep({&kick, 1}, kSubstep);
    double nearest = 1;
    for (int i = 0; i < 100; ++i) {
      Run(world, 0.01);
      nearest = std::min(nearest, world.State(1).pose.position.x());
      REQUIRE(world.State(1).pose.position.allFinite());
      REQUIRE(world.State(1).pose.position.z() > 0.029);
    }
    CAPTURE(shape.index());
    // The wall stopped it; Bullet meets a triangle when it is overlapped, a substep of 1.5 mm late.
    CHECK(nearest == Approx(0.03).margin(2e-3));
  }
}

TEST_CASE("restitution: a ball comes up to e^2 of its height, at any substep") {
  for (const double restitution : {0.5, 0.8, 1.0}) {
    for (const double substep : {1e-3, 5e-3}) {
      BulletWorld world(BallAbove(0.5, restitution), substep);
      const double fall_s = std::sqrt(2 * 0.5 / kGravity);
      Run(world, std::floor(fall_s * 100) / 100 + 0.02);
      double highest = 0;
      for (int i = 0; i < 70; ++i) {
        world.ApplyAndStep({}, 0.01);
        highest = std::max(highest, world.State(1).pose.position.z() - 0.03);
      }
      CAPTURE(restitution, substep);
      // The last substep before the floor is g h of speed short: dv / v = g h / sqrt(2 g H), twice in
      // the height; and the peak is seen every 10 ms, g t^2 / 2 = 0.1 mm at most below it.
      const double exact = restitution * restitution * 0.5;
      CHECK(highest ==
            Approx(exact).epsilon(2 * kGravity * substep / std::sqrt(kGravity)).margin(2e-4));
    }
  }
}

TEST_CASE("without restitution nothing bounces, and what bounced comes to rest") {
  BulletWorld dead(BallAbove(0.2, 0), kSubstep);
  Run(dead, 0.4);
  CHECK(dead.State(1).pose.position.z() == Approx(0.03).margin(1e-4));
  BulletWorld lively(BallAbove(0.05, 0.5), kSubstep);
  Run(lively, 3);
  CHECK(lively.State(1).pose.position.z() == Approx(0.03).margin(1e-4));
  CHECK(lively.State(1).velocity.norm() < 1e-6);

  // Two equal balls, head on: they exchange their speeds.
  Scene scene = FreeCube(0.5);
  scene.bodies.push_back(Cube(0.06, 0.5, 0.3, {0.2, 0, 0}));
  for (SceneBody& body : scene.bodies) {
    body.colliders[0] = {.shape = Sphere{0.03}, .friction = 0.3, .restitution = 1};
  }
  BulletWorld pair(scene, kSubstep);
  const Kick kick{.body = 0, .impulse = {0.5, 0, 0}};
  pair.ApplyAndStep({&kick, 1}, kSubstep);
  Run(pair, 0.3);
  CHECK(pair.State(0).velocity.norm() < 1e-9);
  CHECK((pair.State(1).velocity - Vec3(1, 0, 0)).norm() < 1e-9);
}

TEST_CASE("drag: a falling body comes to its last speed, a free one stops after m v / c") {
  Scene scene = FreeCube(0.5);
  scene.bodies[0].drag_ns_per_m = 2;
  const double rate = 2 / 0.5;
  for (const double substep : {1e-3, 10e-3}) {
    BulletWorld world(scene, substep);
    const Kick kick{.body = 0, .impulse = {0.5, 0, 0}};  // 1 m/s
    world.ApplyAndStep({&kick, 1}, 0);
    Run(world, 1);
    CHECK(world.State(0).velocity.x() == Approx(std::exp(-rate)).epsilon(1e-12));
    // Second order in the substep: (c h / m)^2 / 12.
    const double way = (1 - std::exp(-rate)) / rate;
    CHECK(world.State(0).pose.position.x() ==
          Approx(way).epsilon(rate * rate * substep * substep / 6));
  }
  scene.gravity = {0, 0, -kGravity};
  scene.bodies[0].wind = {3, 0, 0};
  BulletWorld falling(scene, kSubstep);
  Run(falling, 8);
  // Forces after drag: at the end of a substep g h / 2 too much.
  CHECK(falling.State(0).velocity.z() == Approx(-kGravity / rate).margin(kGravity * kSubstep));
  CHECK(falling.State(0).velocity.x() == Approx(3).epsilon(1e-9));
}

TEST_CASE("angular drag slows turning alone, and weightlessness is a body's own") {
  Scene scene = FreeCube(0.5);
  scene.gravity = {0, 0, -kGravity};
  scene.bodies[0].falls = false;
  const double inertia = 0.5 * 0.06 * 0.06 / 6;
  scene.bodies[0].angular_drag_nms = 3 * inertia;
  BulletWorld world(scene, kSubstep);
  const Kick kick{.body = 0, .impulse = {0.5, 0, 0}, .angular_impulse = {0, 0, 10 * inertia}};
  world.ApplyAndStep({&kick, 1}, 0);
  Run(world, 1);
  CHECK((world.State(0).velocity - Vec3(1, 0, 0)).norm() < 1e-12);
  CHECK(world.State(0).pose.position.z() == 0);
  CHECK(world.State(0).angular_velocity.z() ==
        Approx(10 * std::pow(1 + 3 * kSubstep, -1000)).epsilon(1e-9));
}

TEST_CASE("a ball of 10 mm does not go through a wall of 1 mm, whatever its speed and phase") {
  constexpr double kRadius = 0.005;
  constexpr double kHalfWall = 0.0005;
  const Vec3 half(kHalfWall, 0.1, 0.1);
  for (const Shape& wall : {Shape(Box{half}), Shape(MeshOf(test::BoxMesh(half)))}) {
    for (const double substep : {1e-3, 4e-3}) {
      for (const double speed : {2.0, 10.0, 50.0}) {
        for (int phase = 0; phase < 20; ++phase) {
          Scene scene = FreeCube(0.01);
          scene.bodies[0].colliders[0].shape = Sphere{kRadius};
          scene.bodies.push_back(test::Floor(0.3));
          scene.bodies[1].colliders[0].shape = wall;
          const double place = 0.3 + speed * substep * phase / 20;
          scene.bodies[1].pose_WB.position.x() = place;
          BulletWorld world(scene, substep);
          const Kick kick{.body = 0, .impulse = {0.01 * speed, 0, 0}};
          world.ApplyAndStep({&kick, 1}, 0);
          double deepest = 0;
          const int steps = static_cast<int>(0.6 / (speed * substep)) + 20;
          for (int i = 0; i < steps; ++i) {
            world.ApplyAndStep({}, substep);
            const double x = world.State(0).pose.position.x();
            deepest = std::max(deepest, x - (place - kHalfWall - kRadius));
          }
          CAPTURE(wall.index(), substep, speed, phase);
          // Bullet's sweep is of a ball of half the radius: that far it may enter, its centre not.
          REQUIRE(deepest < 0.51 * kRadius);
          REQUIRE(world.State(0).velocity.x() < 1e-3);
        }
      }
    }
  }
}

TEST_CASE("bodies that bounce get no copy, as long as what they bounce off is near") {
  for (const bool near : {true, false}) {
    Scene scene = CubeOnFloor(0.5);
    for (SceneBody& body : scene.bodies) body.colliders[0].restitution = 0.5;
    if (!near) scene.bodies[1].pose_WB.position.z() = 0.3;
    const BulletWorld world(scene, kSubstep);
    std::vector<ContactSite> sites;
    CHECK(world.FindContacts(1, 0.02, sites) == !near);
    CHECK(sites.empty());
  }
}

TEST_CASE("a mesh that is no hull cannot move") {
  Scene scene = CubeOnFloor(0.5);
  scene.bodies[1].colliders[0].shape = MeshOf(test::CornerMesh());
  CHECK_THROWS_AS(BulletWorld(scene, kSubstep), std::invalid_argument);
}

}  // namespace rikiseki::world
