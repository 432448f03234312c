// SPDX-License-Identifier: MIT
// The convex hull of points, for meshes that move.
#pragma once

#include <span>
#include <vector>

#include "common/geometry.h"
#include "world_server/geometry/triangle_mesh.h"

namespace rikiseki::world {

/// The corners are points of the input, exactly; a point within 1e-12 of the size of the hull is not
/// made a corner. Throws std::invalid_argument where the points lie in a plane, or are too few.
TriangleMesh ConvexHull(std::span<const Vec3> points);

}  // namespace rikiseki::world
