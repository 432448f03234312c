// SPDX-License-Identifier: MIT
// How far a shape reaches: what broad phases and step sizes are made of.
#pragma once

#include "common/geometry.h"
#include "world_server/scene/scene.h"

namespace rikiseki::world {

struct Ball {
  Vec3 centre = Vec3::Zero();
  double radius = 0;
};

/// A ball, in the shape's frame, that holds the shape; of infinite radius for a half-space.
Ball OuterBall(const Shape& shape);

/// Radius of the largest ball inside about the frame's origin, 0 where that is outside; infinite for
/// a half-space.
double InnerRadius(const Shape& shape);

}  // namespace rikiseki::world
