// Signed nearest point and outward normal of the primitive shapes: analytic, exact to rounding, and
// right inside as well. The paper's shape feature (section 3.1) is the plane through this point.
#pragma once

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

}  // namespace rikiseki::world
