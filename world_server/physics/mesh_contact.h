// SPDX-License-Identifier: MIT
// Where a convex shape touches or would touch a mesh that cannot move: triangle by triangle, but
// only as the surface has it. An edge or a corner touches where the surface ends in it, so that
// nothing catches between triangles of a flat or hollow place; and points on one flat place are one
// support polygon, as on a half-space.
#pragma once

#include <vector>

#include "world_server/geometry/triangle_mesh.h"
#include "world_server/physics/contact_point.h"
#include "world_server/physics/solid.h"

namespace rikiseki::world {

/// From outside; of an open mesh from both sides. The shape is convex and no sphere, for which
/// FindFeatures tells more.
std::vector<ContactPoint> FindMeshContact(const Solid& first, const Pose& pose_WF,
                                          const TriangleMesh& mesh, const Pose& pose_WM,
                                          double reach_m);

}  // namespace rikiseki::world
