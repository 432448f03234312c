// SPDX-License-Identifier: MIT
// How round a surface is where a finger meets it: what makes a ball better than a plane there.
#pragma once

#include "world_server/features/nearest_point.h"

namespace rikiseki::world {

/// The radius of a ball that touches at a nearest point of the shape and bends as the surface does along
/// `way`, the finger's way over the shape's material [any length, in the shape's frame]; along
/// the way of its strongest bend where the finger stays. m; 0 = flat, or as good as flat.
double RadiusAlong(const Shape& shape, const NearestPoint& nearest, const Vec3& way);

}  // namespace rikiseki::world
