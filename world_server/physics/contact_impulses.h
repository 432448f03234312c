// SPDX-License-Identifier: MIT
// What the contact solver gave a body in its last substep, read back from Bullet's contacts.
#pragma once

#include <span>

#include "world_server/physics/bullet_bodies.h"
#include "world_server/physics/contact_pairs.h"
#include "world_server/physics/dynamics_world.h"

namespace rikiseki::world {

/// Adds each impulse on `body`, times `scale`, to the nearest site of the same pair and direction. `pose_WB` is
/// that of the scene's body, in whose frame the sites are.
void AddImpulses(const MovingBody& body, const Pose& pose_WB, std::span<ContactPair* const> pairs,
                 double scale, std::span<ContactSite> sites);

}  // namespace rikiseki::world
