// SPDX-License-Identifier: MIT
#include "world_server/scene/scene_message.h"

#include <algorithm>
#include <string>

#include "world_server/scene/needs.h"

namespace rikiseki::world {
namespace {

using protocol::SceneCollider;
using protocol::ShapeType;

template <std::size_t kLength>
std::array<char, kLength> Padded(const std::string& name) {
  std::array<char, kLength> text{};
  std::copy_n(name.begin(), std::min(name.size(), text.size() - 1), text.begin());
  return text;
}

void Describe(const Box& box, SceneCollider& c) {
  c.shape = ShapeType::kBox;
  c.dimensions = ToArray(box.half_extents);
}
void Describe(const Sphere& sphere, SceneCollider& c) {
  c.shape = ShapeType::kSphere;
  c.dimensions = {sphere.radius, 0, 0};
}
void Describe(const HalfSpace& half_space, SceneCollider& c) {
  c.shape = ShapeType::kHalfSpace;
  c.dimensions = ToArray(half_space.normal);
}
void Describe(const Cylinder& cylinder, SceneCollider& c) {
  c.shape = ShapeType::kCylinder;
  c.dimensions = {cylinder.radius, cylinder.half_length, 0};
}
void Describe(const Capsule& capsule, SceneCollider& c) {
  c.shape = ShapeType::kCapsule;
  c.dimensions = {capsule.radius, capsule.half_length, 0};
}
void Describe(const Ellipsoid& ellipsoid, SceneCollider& c) {
  c.shape = ShapeType::kEllipsoid;
  c.dimensions = ToArray(ellipsoid.radii);
}

void DescribeMesh(const MeshFile& file, SceneCollider& c) {
  c.shape = ShapeType::kMesh;
  c.dimensions = ToArray(file.scale);
}
void Describe(const Hull& hull, SceneCollider& c) {
  DescribeMesh(hull.file, c);
}
void Describe(const Mesh& mesh, SceneCollider& c) {
  DescribeMesh(mesh.file, c);
}

const MeshFile* FileOf(const Shape& shape) {
  if (const auto* hull = std::get_if<Hull>(&shape)) return &hull->file;
  if (const auto* mesh = std::get_if<Mesh>(&shape)) return &mesh->file;
  return nullptr;
}

}  // namespace

protocol::WorldScene DescribeScene(const Scene& scene, std::span<const protocol::Body> bodies,
                                   std::uint64_t revision, const SceneUse& use) {
  protocol::WorldScene message;
  message.revision = revision;
  message.gravity = ToArray(scene.gravity);
  message.name = Padded<64>(scene.name);
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
    const SceneBody& body = scene.bodies[i];
    message.bodies.push_back({bodies[i].body, bodies[i].generation, body.fixed ? 1u : 0u,
                              static_cast<std::uint32_t>(body.colliders.size()),
                              Padded<64>(body.name)});
    for (const Collider& collider : body.colliders) {
      SceneCollider& c = message.colliders.emplace_back();
      std::visit([&c](const auto& shape) { Describe(shape, c); }, collider.shape);
      c.position = ToArray(collider.pose_BS.position);
      c.orientation = ToArray(collider.pose_BS.orientation);
      if (const MeshFile* file = FileOf(collider.shape)) {
        message.meshes.push_back({.sha256 = file->sha256, .path = Padded<224>(file->path)});
      }
    }
  }
  const SceneNeeds worked_out = WorkOutNeeds(scene, use);
  message.needs = worked_out.needs;
  message.left_out = worked_out.left_out;
  return message;
}

}  // namespace rikiseki::world
