// SPDX-License-Identifier: MIT
#include "world_server/features/nearest_point.h"

#include "world_server/features/nearest_mesh.h"
#include "world_server/features/nearest_primitives.h"

namespace rikiseki::world {
namespace {

NearestPoint FindNearest(const Hull& hull, const Vec3& p) {
  return FindNearest(*hull.mesh, p);
}

NearestPoint FindNearest(const Mesh& mesh, const Vec3& p) {
  return FindNearest(*mesh.mesh, p);
}

}  // namespace

NearestPoint FindNearestPoint(const Shape& shape, const Vec3& p) {
  return std::visit([&](const auto& given) { return FindNearest(given, p); }, shape);
}

void FindFeatures(const Shape& shape, const Vec3& p, double radius,
                  std::vector<NearestPoint>& found) {
  found.clear();
  if (const auto* mesh = std::get_if<Mesh>(&shape)) {
    FindMeshFeatures(*mesh->mesh, p, radius, found);
    return;
  }
  const NearestPoint nearest = FindNearestPoint(shape, p);
  if (nearest.distance <= radius) found.push_back(nearest);
}

}  // namespace rikiseki::world
