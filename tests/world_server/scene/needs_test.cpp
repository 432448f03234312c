// SPDX-License-Identifier: MIT
#include "world_server/scene/needs.h"

#include <catch2/catch.hpp>
#include <functional>

#include "tests/world_server/scenes.h"

namespace rikiseki::world {
namespace {

using test::Cube;
using test::CubeOnFloor;
using test::Floor;
using test::FreeCube;

bool Needs(std::uint64_t bit, const Scene& scene, const SceneUse& use = {}) {
  const SceneNeeds found = WorkOutNeeds(scene, use);
  CHECK((found.needs | found.left_out) == protocol::kAllSceneNeeds);
  CHECK((found.needs & found.left_out) == 0);
  return (found.needs & bit) != 0;
}

Scene Changed(Scene scene, const std::function<void(Scene&)>& change) {
  change(scene);
  return scene;
}

}  // namespace

TEST_CASE("what cannot move needs nothing, but the finger's friction where it has some") {
  Scene still;
  still.bodies = {Floor(0.5), Floor(0.3)};
  CHECK(WorkOutNeeds(still).needs == 0);
  CHECK(WorkOutNeeds(still, {.finger_friction = 0.2}).needs == protocol::kNeedFriction);
  still.bodies = {Floor(0)};
  CHECK(WorkOutNeeds(still, {.finger_friction = 0.2}).needs == 0);
}

TEST_CASE("contacts among them: two that move") {
  CHECK_FALSE(Needs(protocol::kNeedBodyContacts, CubeOnFloor(0.5)));
  CHECK(Needs(protocol::kNeedBodyContacts, Changed(CubeOnFloor(0.5), [](Scene& s) {
                s.bodies.push_back(Cube(0.05, 1, 0.5, {1, 0, 0}));
              })));
}

TEST_CASE("friction: two that could meet, both with some") {
  CHECK(Needs(protocol::kNeedFriction, CubeOnFloor(0.5)));
  CHECK_FALSE(Needs(protocol::kNeedFriction, CubeOnFloor(0)));
  CHECK_FALSE(Needs(protocol::kNeedFriction, FreeCube(1)));
  const auto floor_of = [](double friction) {
    return Changed(CubeOnFloor(0.5),
                   [=](Scene& s) { s.bodies[0].colliders[0].friction = friction; });
  };
  CHECK_FALSE(Needs(protocol::kNeedFriction, floor_of(0)));
  // A second cube of the same kind, and the two may rub on each other.
  CHECK(Needs(protocol::kNeedFriction, Changed(floor_of(0), [](Scene& s) {
                s.bodies.push_back(Cube(0.05, 1, 0.5, {1, 0, 0}));
              })));
  // Two walls do not.
  CHECK_FALSE(Needs(protocol::kNeedFriction, Changed(CubeOnFloor(0), [](Scene& s) {
                      s.bodies[0].colliders[0].friction = 1;
                      s.bodies.push_back(Floor(1));
                    })));
}

TEST_CASE("rotation needs unequal moments of what can move, fast bodies need something to meet") {
  CHECK_FALSE(Needs(protocol::kNeedRotation, CubeOnFloor(0.5)));
  CHECK(Needs(protocol::kNeedRotation,
              Changed(CubeOnFloor(0.5), [](Scene& s) { s.bodies[1].inertia(2, 2) *= 1.01; })));
  CHECK(Needs(protocol::kNeedFastBodies, CubeOnFloor(0.5)));
  CHECK_FALSE(Needs(protocol::kNeedFastBodies, FreeCube(1)));
}

TEST_CASE("drag needs air and what can move, local bodies need that coupling") {
  CHECK_FALSE(Needs(protocol::kNeedDrag, CubeOnFloor(0.5)));
  CHECK(Needs(protocol::kNeedDrag,
              Changed(CubeOnFloor(0.5), [](Scene& s) { s.bodies[1].angular_drag_nms = 1; })));
  CHECK_FALSE(Needs(protocol::kNeedDrag,
                    Changed(CubeOnFloor(0.5), [](Scene& s) { s.bodies[0].drag_ns_per_m = 1; })));
  CHECK(Needs(protocol::kNeedLocalBodies, FreeCube(1)));
  CHECK_FALSE(
      Needs(protocol::kNeedLocalBodies, FreeCube(1), {.coupling = protocol::Coupling::kImpulse}));
}

TEST_CASE("in words") {
  CHECK(InWords(0) == "nothing");
  CHECK(InWords(protocol::kNeedMovingBodies | protocol::kNeedDrag) == "moving bodies, drag");
}

}  // namespace rikiseki::world
