// SPDX-License-Identifier: MIT
// Nearest points of the shapes that formulas describe. `p` is in the shape's frame and finite.
#pragma once

#include "world_server/features/nearest_point.h"

namespace rikiseki::world {

NearestPoint FindNearest(const Box& box, const Vec3& p);
NearestPoint FindNearest(const Sphere& sphere, const Vec3& p);
NearestPoint FindNearest(const HalfSpace& half_space, const Vec3& p);
NearestPoint FindNearest(const Cylinder& cylinder, const Vec3& p);
NearestPoint FindNearest(const Capsule& capsule, const Vec3& p);
NearestPoint FindNearest(const Ellipsoid& ellipsoid, const Vec3& p);

}  // namespace rikiseki::world
