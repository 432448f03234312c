// SPDX-License-Identifier: MIT
#include "world_server/scene/scene_message.h"

#include <catch2/catch.hpp>

namespace rikiseki::world {
namespace {

TEST_CASE("a scene is described body by body, collider by collider") {
  Scene scene;
  scene.name = std::string(100, 's');
  scene.gravity = Vec3(0, 0, -1.5);
  scene.bodies.resize(2);
  scene.bodies[0].name = "floor::link";
  scene.bodies[0].fixed = true;
  scene.bodies[0].colliders = {
      {.shape = HalfSpace{Vec3::UnitY()}},
      {.shape = Cylinder{0.1, 0.2}, .pose_BS = {Vec3(1, 2, 3), Quat(0, 0, 1, 0)}}};
  scene.bodies[1].name = "block::link";
  scene.bodies[1].mass_kg = 1;
  scene.bodies[1].colliders = {
      {.shape = Box{Vec3(4, 5, 6)}},
      {.shape = Sphere{7}},
      {.shape = Capsule{8, 9}},
      {.shape = Ellipsoid{Vec3(10, 11, 12)}},
      {.shape = Hull{.mesh = nullptr,
                     .file = {.path = "/a/b.stl", .sha256 = {1, 2}, .scale = Vec3(1, 2, 3)}}},
      {.shape = Mesh{.mesh = nullptr, .file = {.path = "/c.obj"}}}};
  std::vector<protocol::Body> bodies(2);
  bodies[0].body = 0;
  bodies[0].generation = 3;
  bodies[1].body = 1;
  bodies[1].generation = 4;
  const protocol::WorldScene message = DescribeScene(scene, bodies, 5);
  CHECK(message.revision == 5);
  CHECK(message.gravity == protocol::Vector{0, 0, -1.5});
  CHECK(std::string(message.name.data()) == std::string(63, 's'));
  CHECK(message.needs == (protocol::kNeedMovingBodies | protocol::kNeedFastBodies |
                          protocol::kNeedFriction | protocol::kNeedLocalBodies));
  CHECK(message.left_out == (protocol::kAllSceneNeeds ^ message.needs));
  REQUIRE(message.bodies.size() == 2);
  CHECK(message.bodies[0].fixed == 1);
  CHECK(message.bodies[0].generation == 3);
  CHECK(message.bodies[0].collider_count == 2);
  CHECK(std::string(message.bodies[1].name.data()) == "block::link");
  CHECK(message.bodies[1].body == 1);
  CHECK(message.bodies[1].fixed == 0);
  REQUIRE(message.colliders.size() == 8);
  using protocol::ShapeType;
  using protocol::Vector;
  const auto& c = message.colliders;
  CHECK(c[0].shape == ShapeType::kHalfSpace);
  CHECK(c[0].dimensions == Vector{0, 1, 0});
  CHECK(c[1].shape == ShapeType::kCylinder);
  CHECK(c[1].dimensions == Vector{0.1, 0.2, 0});
  CHECK(c[1].position == Vector{1, 2, 3});
  CHECK(c[1].orientation == protocol::Quaternion{0, 0, 1, 0});
  CHECK(c[2].dimensions == Vector{4, 5, 6});
  CHECK(c[3].shape == ShapeType::kSphere);
  CHECK(c[3].dimensions == Vector{7, 0, 0});
  CHECK(c[4].shape == ShapeType::kCapsule);
  CHECK(c[4].dimensions == Vector{8, 9, 0});
  CHECK(c[5].shape == ShapeType::kEllipsoid);
  CHECK(c[6].shape == ShapeType::kMesh);
  CHECK(c[6].dimensions == Vector{1, 2, 3});
  CHECK(c[7].shape == ShapeType::kMesh);
  REQUIRE(message.meshes.size() == 2);
  CHECK(std::string(message.meshes[0].path.data()) == "/a/b.stl");
  CHECK(message.meshes[0].sha256[1] == 2);
  CHECK(std::string(message.meshes[1].path.data()) == "/c.obj");

  scene.bodies.resize(1);
  const protocol::WorldScene still = DescribeScene(scene, bodies, 6);
  CHECK(still.needs == 0);
  CHECK(still.left_out == protocol::kAllSceneNeeds);
}

}  // namespace
}  // namespace rikiseki::world
