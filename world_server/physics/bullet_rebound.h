// Restitution after Newton: a contact that was closed at a speed is left at e times that speed. Bullet's
// own rule asks for the rebound while there is still a gap to cross, takes the crossing off it, and
// loses the more energy the smaller the step is.
#pragma once

#include <vector>

#include "world_server/physics/bullet_hooks.h"

namespace rikiseki::world {

/// What closes more slowly does not bounce; and nothing that falls for two substeps only.
inline constexpr double kSlowestBounce = 0.02;  // m/s

/// Gives the rebound of the substep that has just ended to the velocities. `restitutions` is by the
/// third user index of the rigid bodies; two combine as their product.
void Rebound(btDiscreteDynamicsWorld& world, const std::vector<HookedBody>& bodies,
             const std::vector<double>& restitutions, double step_s);

}  // namespace rikiseki::world
