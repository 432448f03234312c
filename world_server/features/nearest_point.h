// SPDX-License-Identifier: MIT
// Signed nearest point and outward normal of every shape: analytic and exact to rounding for the
// primitives, exact per triangle for hulls and meshes, and right inside as well. The paper's shape
// feature (section 3.1) is the plane through this point.
#pragma once

#include <vector>

#include "common/geometry.h"
#include "world_server/scene/scene.h"

namespace rikiseki::world {

struct NearestPoint {
  Vec3 point = Vec3::Zero();    // on the surface, in the shape's frame
  Vec3 normal = Vec3::UnitZ();  // unit, out of the solid
  double distance = 0;          // m, negative inside: p = point + distance * normal
  bool degenerate = false;  // other nearest points or normals exist; the choice is deterministic
};

/// `p` is in the shape's frame and finite.
NearestPoint FindNearestPoint(const Shape& shape, const Vec3& p);

/// No shape has more features at a time.
inline constexpr std::size_t kMaxFeatures = 8;

/// All that a point may touch of a shape within `radius` of it [m], nearest first: one nearest point
/// for a convex shape; of a mesh one for each local minimum of the distance, so that both walls of a
/// corner are felt, at most kMaxFeatures. Inside a mesh they are those of the nearest surface point,
/// from outside. None where the shape is farther. Of nearly parallel ones (5 degrees) the nearest.
/// `found` is emptied first.
void FindFeatures(const Shape& shape, const Vec3& p, double radius,
                  std::vector<NearestPoint>& found);

}  // namespace rikiseki::world
