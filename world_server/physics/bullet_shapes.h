// SPDX-License-Identifier: MIT
// Scene shapes as Bullet collision shapes, without the rounding that Bullet's default margins
// bring.
#pragma once

#include <BulletCollision/CollisionShapes/btCollisionShape.h>

#include <memory>

#include "world_server/physics/solid.h"

namespace rikiseki::world {

/// In the shape's own frame; a half-space is a plane through the origin, a mesh is for bodies that
/// cannot move. Holds all that it needs of `shape`.
std::unique_ptr<btCollisionShape> MakeBulletShape(const Shape& shape);

/// What a shape that was made here stands for, exactly.
const Solid& SolidOf(const btCollisionShape& made);

}  // namespace rikiseki::world
