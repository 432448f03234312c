// SPDX-License-Identifier: MIT
#include "world_server/physics/engine_parts.h"

#include <catch2/catch.hpp>
#include <cstring>
#include <vector>

#include "tests/world_server/scenes.h"
#include "world_server/physics/bullet_world.h"

namespace rikiseki::world {
namespace {

using test::Cube;
using test::CubeOnFloor;
using test::FreeCube;

std::vector<double> Bits(const Scene& scene, const EngineParts& parts) {
  BulletWorld world(scene, 1e-3, parts);
  std::vector<double> bits;
  std::vector<PlacedImpulse> pushes(50);
  std::vector<Stretch> period(50);
  for (int frame = 0; frame < 20; ++frame) {
    for (std::size_t i = 0; i < 50; ++i) {
      const double part = frame < 5 ? 1e-4 * static_cast<double>(i % 7) : 0;
      pushes[i] = {.body = scene.bodies.size() - 1,
                   .impulse = {part, -part / 2, part / 3},
                   .angular_impulse = {0.01 * part, 0, 0.02 * part}};
      period[i] = {.length_s = 1e-3, .pushes = {&pushes[i], 1}};
    }
    world.Play(period);
    for (std::size_t body = 0; body < world.body_count(); ++body) {
      const BodyState state = world.State(body);
      for (const double v : state.pose.position) bits.push_back(v);
      for (const double v : state.pose.orientation.coeffs()) bits.push_back(v);
      for (const double v : state.velocity) bits.push_back(v);
      for (const double v : state.angular_velocity) bits.push_back(v);
    }
  }
  return bits;
}

bool Same(const std::vector<double>& a, const std::vector<double>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(double)) == 0;
}

// Two cubes on a floor of box shape, whose contacts are kept from step to step.
Scene Gliding() {
  Scene scene = CubeOnFloor(0, 0.06, 0.3);
  scene.bodies[0].colliders[0] = {.shape = Box{{1, 1, 0.1}}, .friction = 0};
  scene.bodies[0].pose_WB.position.z() = -0.1;
  scene.bodies.push_back(Cube(0.04, 0.05, 0, {-0.0502, 0, 0.02}));
  return scene;
}

}  // namespace

TEST_CASE("the parts are those that the scene needs") {
  const EngineParts cube = EngineParts::Of(CubeOnFloor(0.5));
  CHECK(cube.contacts);
  CHECK(cube.friction);
  CHECK(cube.fast_bodies);
  CHECK_FALSE(cube.rotation);
  CHECK_FALSE(cube.drag);
  CHECK_FALSE(cube.rebound);
  CHECK_FALSE(EngineParts::Of(CubeOnFloor(0)).friction);
  const EngineParts free = EngineParts::Of(FreeCube(1));
  CHECK_FALSE(free.contacts);
  CHECK_FALSE(free.friction);
  CHECK_FALSE(free.fast_bodies);
  Scene bouncing = CubeOnFloor(0.5);
  for (SceneBody& body : bouncing.bodies) body.colliders[0].restitution = 0.5;
  CHECK(EngineParts::Of(bouncing).rebound);
  bouncing.bodies[0].colliders[0].restitution = 0;
  CHECK_FALSE(EngineParts::Of(bouncing).rebound);
}

TEST_CASE("left out is in with nothing to do, to the bit") {
  const EngineParts all;
  for (const Scene& scene : {Gliding(), CubeOnFloor(0.4), FreeCube(0.3)}) {
    const EngineParts needed = EngineParts::Of(scene);
    const std::vector<double> whole = Bits(scene, all);
    CHECK(Same(Bits(scene, needed), whole));
    for (bool EngineParts::*part :
         {&EngineParts::contacts, &EngineParts::friction, &EngineParts::rotation,
          &EngineParts::drag, &EngineParts::rebound}) {
      EngineParts without = all;
      without.*part = false;
      CAPTURE(scene.bodies.size(), scene.bodies.back().colliders[0].friction);
      // What the scene needs is missed, what it does not need is not.
      CHECK(Same(Bits(scene, without), whole) == !(needed.*part));
    }
  }
}

TEST_CASE("sweeping fast bodies changes nothing where none is fast") {
  EngineParts without;
  without.fast_bodies = false;
  CHECK(Same(Bits(CubeOnFloor(0.4), without), Bits(CubeOnFloor(0.4), {})));
}

}  // namespace rikiseki::world
