// SPDX-License-Identifier: MIT
#include "world_server/scene/scene_change.h"

#include <catch2/catch.hpp>

#include "tests/world_server/meshes.h"
#include "tests/world_server/scenes.h"

namespace rikiseki::world {
namespace {

Scene ThreeBodies() {
  Scene scene = test::CubeOnFloor(0.3);
  scene.bodies.push_back(test::Cube(0.04, 0.5, 0.3, {0.2, 0, 0.02}));
  scene.bodies[2].name = "other::link";
  return scene;
}

void CheckOne(const BodyChange& change, std::size_t before, bool same, bool goes_on) {
  CHECK(change.before == before);
  CHECK(change.same == same);
  CHECK(change.goes_on == goes_on);
}

}  // namespace

TEST_CASE(
    "a scene that says the same changes nothing, and started anew, what moves is another thing") {
  const Scene scene = ThreeBodies();
  CHECK(scene == ThreeBodies());
  const auto changed = Changed(scene, scene);
  REQUIRE(changed.size() == 3);
  CheckOne(changed[0], 0, true, false);
  CheckOne(changed[1], 1, true, true);
  CheckOne(changed[2], 2, true, true);
  const auto restarted = Restarted(scene, scene);
  CheckOne(restarted[0], 0, true, false);
  CheckOne(restarted[1], 1, false, false);
  CheckOne(restarted[2], 2, false, false);
}

TEST_CASE("bodies are known by their names, in whatever order they stand") {
  const Scene before = ThreeBodies();
  Scene now = before;
  std::swap(now.bodies[0], now.bodies[2]);
  now.bodies[1].name = "new::link";
  const auto changed = Changed(before, now);
  CheckOne(changed[0], 2, true, true);
  CHECK_FALSE(changed[1].before);
  CHECK_FALSE(changed[1].same);
  CheckOne(changed[2], 0, true, false);

  Scene twins = before;
  twins.bodies[2].name = twins.bodies[1].name;
  Scene one_twin = twins;
  one_twin.bodies.erase(one_twin.bodies.begin() + 1);
  const auto first = Changed(twins, one_twin);
  CheckOne(first[1], 1, false, false);
}

TEST_CASE(
    "whatever is described differently makes another thing, only another place ends the way") {
  const Scene before = ThreeBodies();
  const auto alter = [&](auto&& how) {
    Scene now = before;
    how(now.bodies[1]);
    CHECK_FALSE(now == before);
    return Changed(before, now)[1];
  };
  CheckOne(alter([](SceneBody& b) { b.pose_WB.position.x() += 1e-12; }), 1, false, false);
  CheckOne(alter([](SceneBody& b) { b.pose_WB.orientation = Quat(0, 1, 0, 0); }), 1, false, false);
  CheckOne(alter([](SceneBody& b) { b.mass_kg = 2; }), 1, false, true);
  CheckOne(alter([](SceneBody& b) { b.inertia *= 2; }), 1, false, true);
  CheckOne(alter([](SceneBody& b) { b.falls = false; }), 1, false, true);
  CheckOne(alter([](SceneBody& b) { b.drag_ns_per_m = 1; }), 1, false, true);
  CheckOne(alter([](SceneBody& b) { b.colliders[0].friction = 0.2; }), 1, false, true);
  CheckOne(alter([](SceneBody& b) { b.colliders[0].stiffness_n_per_m = 500; }), 1, false, true);
  CheckOne(alter([](SceneBody& b) { b.colliders[0].shape = Sphere{0.03}; }), 1, false, true);
  CheckOne(alter([](SceneBody& b) { b.colliders[0].pose_BS.position.z() = 0.01; }), 1, false, true);
  CheckOne(alter([](SceneBody& b) { b.fixed = true; }), 1, false, false);

  Scene now = before;
  now.gravity.setZero();
  CHECK_FALSE(now == before);
  CHECK(Changed(before, now)[1].same);
}

TEST_CASE("a mesh that was read again is the same if its triangles are") {
  const auto mesh = [](double edge) {
    SceneBody body = test::Floor(0.3);
    body.colliders[0].shape = Mesh{
        .mesh = std::make_shared<TriangleMesh>(test::Build(test::BoxMesh(Vec3::Constant(edge))))};
    return Scene{.name = "mesh", .bodies = {body}};
  };
  CHECK(mesh(1) == mesh(1));
  CHECK_FALSE(mesh(1) == mesh(2));
  Scene renamed = mesh(1);
  std::get<Mesh>(renamed.bodies[0].colliders[0].shape).file.sha256[0] = 1;
  CHECK_FALSE(renamed == mesh(1));
}

TEST_CASE("what joints link goes on as a whole, or starts as a whole") {
  Scene before = ThreeBodies();
  before.bodies.push_back(before.bodies[2]);
  before.bodies[3].name = "third::link";
  before.joints = {{.name = "a", .parent = 0, .child = 1}, {.name = "b", .parent = 1, .child = 2}};
  for (const BodyChange& change : Changed(before, before)) CHECK(change.same);

  // Another model before it shifts the places and the models' numbers: nothing else.
  Scene now = before;
  now.bodies.insert(now.bodies.begin(), test::Floor(0.3));
  now.bodies[0].name = "new::link";
  for (SceneBody& body : now.bodies) ++body.model;
  for (Joint& joint : now.joints)
    joint = {.name = joint.name, .parent = joint.parent + 1, .child = joint.child + 1};
  auto changed = Changed(before, now);
  for (std::size_t i = 1; i < 5; ++i) CHECK(changed[i].same);

  // One of them is put elsewhere, or a joint is another: all that is linked starts.
  now = before;
  now.bodies[2].pose_WB.position.x() += 0.1;
  changed = Changed(before, now);
  CheckOne(changed[0], 0, true, false);
  CheckOne(changed[1], 1, false, false);
  CheckOne(changed[2], 2, false, false);
  CheckOne(changed[3], 3, true, true);
  now = before;
  now.joints[0].damping = 1;
  changed = Changed(before, now);
  CheckOne(changed[0], 0, true, false);
  CheckOne(changed[2], 2, false, false);
  CheckOne(changed[3], 3, true, true);
  now = before;
  now.bodies[0].pose_WB.position.z() = 0.1;
  CheckOne(Changed(before, now)[2], 2, false, false);

  // Without its joint a body goes on, as another thing.
  now = before;
  now.joints.pop_back();
  changed = Changed(before, now);
  CheckOne(changed[1], 1, false, true);
  CheckOne(changed[2], 2, false, true);
}

}  // namespace rikiseki::world
