// SPDX-License-Identifier: MIT
// Restitution after Newton: a contact that was closed at a speed is left at e times that speed. Bullet's
// own rule asks for the rebound while there is still a gap to cross, takes the crossing off it, and
// loses the more energy the smaller the step is.
#pragma once

#include <span>

#include "world_server/physics/bullet_bodies.h"

namespace rikiseki::world {

/// What closes more slowly does not bounce; and nothing that falls for two substeps only.
inline constexpr double kSlowestBounce = 0.02;  // m/s

/// Gives the rebound of the substep that has just ended to the velocities. Two surfaces' restitutions
/// combine as their product. `gravity` in m/s^2. Whether anything bounced.
bool Rebound(std::span<btPersistentManifold* const> manifolds, const BulletBodies& bodies,
             double gravity, double step_s);

}  // namespace rikiseki::world
