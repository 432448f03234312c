// SPDX-License-Identifier: MIT
#include "world_server/physics/islands.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <random>
#include <vector>

#include "tests/world_server/scenes.h"
#include "world_server/physics/bullet_world.h"

namespace rikiseki::world {
namespace {

using test::Cube;
using test::CubeOnFloor;
using test::Floor;

// Ticks of 1 ms, each with a push of one body.
struct PushedPeriod {
  std::vector<PlacedImpulse> pushes;
  std::vector<Stretch> stretches;

  PushedPeriod(int ticks, std::size_t body, const Vec3& impulse, const Vec3& place = Vec3::Zero())
      : pushes(static_cast<std::size_t>(ticks),
               {.body = body, .impulse = impulse, .angular_impulse = place.cross(impulse)}) {
    for (const PlacedImpulse& push : pushes) {
      stretches.push_back({.length_s = 1e-3, .pushes = {&push, 1}});
    }
  }
};

Scene Floating(int count, double apart) {
  Scene scene;
  scene.gravity.setZero();
  for (int i = 0; i < count; ++i) {
    scene.bodies.push_back(Cube(0.03, 0.1, 0.3, {apart * i, 0, 0}));
    scene.bodies.back().colliders[0].shape = Sphere{0.015};
  }
  return scene;
}

Vec3 Momentum(const Scene& scene, const BulletWorld& world) {
  Vec3 sum = Vec3::Zero();
  for (std::size_t i = 0; i < world.body_count(); ++i) {
    sum += scene.bodies[i].mass_kg * world.State(i).velocity;
  }
  return sum;
}

}  // namespace

TEST_CASE("a push costs substeps of a tick only where it reaches") {
  const Scene scene = Floating(100, 0.2);
  BulletWorld world(scene, 1e-3);
  // All awake: each drifts by itself.
  for (std::size_t i = 0; i < 100; ++i) {
    const Kick kick{.body = i, .impulse = {0, 1e-4, 0}};
    world.ApplyAndStep({&kick, 1}, 0);
  }
  world.ApplyAndStep({}, 1e-3);
  const std::uint64_t before = world.substeps();
  world.Play(PushedPeriod(50, 7, {0, 0, 1e-4}, {7 * 0.2, 0, 0}).stretches);
  // 50 ticks of the one, five windows of the 99 others.
  CHECK(world.substeps() - before == 50 + 99 * 5);
  // Pushed at the start of each tick: z = sum of v dt.
  CHECK(world.State(7).pose.position.z() == Approx(1e-4 / 0.1 * 1e-3 * 50 * 51 / 2).epsilon(1e-9));
  for (std::size_t i = 0; i < 100; ++i) {
    CHECK(world.State(i).pose.position.y() == Approx(1e-3 * 0.051).epsilon(1e-9));
  }
}

TEST_CASE("bodies of different groups that come to meet each other within a period meet") {
  for (const double speed : {0.3, 3.0, 20.0}) {
    for (const double apart : {0.1, 0.5}) {
      const Scene scene = Floating(2, apart);
      BulletWorld world(scene, 1e-3);
      const Kick kicks[] = {{.body = 0, .impulse = {0.1 * speed, 0, 0}},
                            {.body = 1, .impulse = {-0.05 * speed, 0, 0}}};
      world.ApplyAndStep(kicks, 0);
      const Stretch period{.length_s = 0.05};
      for (int i = 0; i < 50; ++i) world.Play({&period, 1});
      CAPTURE(speed, apart);
      CHECK(world.State(1).pose.position.x() - world.State(0).pose.position.x() > 0.0299);
      CHECK(Momentum(scene, world).x() == Approx(0.05 * speed).epsilon(1e-9));
      // They part no faster than a penetration is taken back: 0.2 of 0.1 mm in a substep of 1 ms.
      const double parting = world.State(1).velocity.x() - world.State(0).velocity.x();
      CHECK(parting > -1e-6 * speed);
      CHECK(parting < 0.02 + 1e-6);
    }
  }
}

TEST_CASE("what a heavy one strikes is faster than it, and is met in time") {
  // Without loss 1 kg at v gives 10 g 1.98 v, which it carries over 6 cm to the last one.
  for (const double speed : {1.0, 2.0, 4.0, 8.0}) {
    Scene scene = Floating(3, 0.04);
    scene.bodies[0].mass_kg = 1;
    scene.bodies[1].mass_kg = 0.01;
    scene.bodies[2].pose_WB.position.x() = 0.04 + 0.09;
    for (SceneBody& body : scene.bodies) {
      body.inertia = Mat3::Identity() * (0.4 * body.mass_kg * 0.015 * 0.015);
      body.colliders[0].restitution = 1;
    }
    BulletWorld world(scene, 1e-3);
    const Kick kick{.body = 0, .impulse = {speed, 0, 0}};
    world.ApplyAndStep({&kick, 1}, 0);
    double nearest = 1;
    const Stretch tick{.length_s = 0.01};
    for (int i = 0; i < 40; ++i) {
      world.Play({&tick, 1});
      nearest =
          std::min(nearest, world.State(2).pose.position.x() - world.State(1).pose.position.x());
    }
    CAPTURE(speed);
    CHECK(nearest > 0.0299);
    CHECK(world.State(2).velocity.x() > 0.1 * speed);
    CHECK(Momentum(scene, world).x() == Approx(speed).epsilon(1e-9));
  }
}

TEST_CASE("momentum is exact across islands, however pushes are spread") {
  const Scene scene = Floating(20, 0.05);
  BulletWorld world(scene, 1e-3);
  std::mt19937 random(3);
  std::uniform_real_distribution<double> any(-1, 1);
  Vec3 total = Vec3::Zero();
  for (int frame = 0; frame < 40; ++frame) {
    std::vector<PlacedImpulse> pushes;
    for (int i = 0; i < 50; ++i) {
      const Vec3 impulse = 2e-4 * Vec3(any(random), any(random), any(random));
      pushes.push_back({.body = random() % 20, .impulse = impulse});
      total += impulse;
    }
    std::vector<Stretch> period;
    for (const PlacedImpulse& push : pushes) {
      period.push_back({.length_s = 1e-3, .pushes = {&push, 1}});
    }
    world.Play(period);
    REQUIRE((Momentum(scene, world) - total).norm() < 1e-12);
  }
}

TEST_CASE("played is stepped: a pushed cube moves as if every tick were stepped alone") {
  const Scene scene = CubeOnFloor(0.3, 0.06, 0.5);
  BulletWorld played(scene, 1e-3);
  BulletWorld stepped(scene, 1e-3);
  for (int frame = 0; frame < 20; ++frame) {
    const PushedPeriod period(50, 1, {frame < 6 ? 3e-3 : 0, 0, 0});
    played.Play(period.stretches);
    stepped.DynamicsWorld::Play(period.stretches);
  }
  const Vec3 difference = played.State(1).pose.position - stepped.State(1).pose.position;
  CHECK(stepped.State(1).pose.position.x() > 0.02);
  // Unpushed it slides in substeps of up to 5 ms: mu g h^2 / 2 = 37 um where it stops.
  CHECK(difference.norm() < 5e-5);
}

TEST_CASE("bodies held by nothing but the broad phase's reach fall apart into groups of one") {
  BulletBodies bodies(Floating(3, 0.04));  // 1 cm between them
  btDefaultCollisionConfiguration configuration;
  btCollisionDispatcher dispatcher(&configuration);
  btDbvtBroadphase broadphase;
  btSequentialImpulseConstraintSolver solver;
  btDiscreteDynamicsWorld world(&dispatcher, &broadphase, &solver, &configuration);
  for (const auto& rigid : bodies.rigid_bodies) world.addRigidBody(rigid.get());
  {
    ContactPairs pairs(dispatcher, bodies.moving.size());
    Sleepers sleepers(bodies.moving, true);
    Islands islands(bodies, pairs, sleepers, broadphase, world, true);
    std::vector<double> pushed(3, 0.0);
    CHECK(islands.Plan(0.01, pushed).size() == 3);
    pushed[1] = 0.6;  // within 10 ms the middle one may come to both others
    const auto groups = islands.Plan(0.01, pushed);
    REQUIRE(groups.size() == 1);
    CHECK(groups[0].members == std::vector<std::size_t>{0, 1, 2});
    CHECK(groups[0].pairs.size() == 2);  // the outer ones cannot meet
    pushed[1] = 0;
    // A joint holds two together however far.
    btPoint2PointConstraint joint(*bodies.moving[0].rigid, *bodies.moving[2].rigid,
                                  btVector3(0.04, 0, 0), btVector3(-0.04, 0, 0));
    world.addConstraint(&joint, true);
    const auto joined = islands.Plan(0.01, pushed);
    REQUIRE(joined.size() == 2);
    CHECK(joined[0].members == std::vector<std::size_t>{0, 2});
    CHECK(joined[0].joints.size() == 1);
    world.removeConstraint(&joint);
  }
  for (const auto& rigid : bodies.rigid_bodies) world.removeRigidBody(rigid.get());
}

}  // namespace rikiseki::world
