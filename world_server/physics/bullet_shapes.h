// Scene shapes as Bullet collision shapes, without the rounding that Bullet's default margins
// bring.
#pragma once

#include <BulletCollision/CollisionShapes/btCollisionShape.h>

#include <memory>

#include "world_server/scene/scene.h"

namespace rikiseki::world {

/// In the shape's own frame; a half-space is a plane through the origin.
std::unique_ptr<btCollisionShape> MakeBulletShape(const Shape& shape);

/// Radius of the largest ball inside, about the shape's centre; infinite for a half-space.
double InnerRadius(const Shape& shape);

/// Radius of the smallest ball about the shape's centre that holds it; infinite for a half-space.
double OuterRadius(const Shape& shape);

}  // namespace rikiseki::world
