// SPDX-License-Identifier: MIT
// Nearest points of triangle meshes, convex hulls among them: a walk down the mesh's tree, exact per
// triangle, the sign from angle-weighted normals. Inside is where they say so: behind an open mesh
// too, but not beyond its border.
#pragma once

#include <vector>

#include "world_server/features/nearest_point.h"
#include "world_server/geometry/triangle_mesh.h"

namespace rikiseki::world {

NearestPoint FindNearest(const TriangleMesh& mesh, const Vec3& p);

/// FindFeatures for a mesh that need not be convex. Farther than `radius` behind an open one nothing
/// is felt.
void FindMeshFeatures(const TriangleMesh& mesh, const Vec3& p, double radius,
                      std::vector<NearestPoint>& found);

}  // namespace rikiseki::world
