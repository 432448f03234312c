// SPDX-License-Identifier: MIT
// What joints leave of a body, in the words of a local copy, which knows bodies, points and planes alone:
// a joint is planes that face each other without friction, so that the points between them stay.
#pragma once

#include <span>
#include <vector>

#include "common/rigid_body.h"
#include "world_server/physics/dynamics_world.h"
#include "world_server/scene/scene.h"

namespace rikiseki::world {

/// Where the joints of a scene's body hold it, and limits that are less than a radian or `reach_m` away.
/// Eight planes at two points of a hinge's axis and two along it; ten of a slide likewise; six of a ball.
/// Nothing of a body without a joint.
std::vector<ContactSite> JointSites(const Scene& scene, std::span<const BodyState> states,
                                    std::size_t body, double reach_m);

/// Whether the body's joints let it move along the normal of a contact with something fixed.
bool JointsLetMeet(const Scene& scene, std::span<const BodyState> states, std::size_t body,
                   const ContactSite& site);

/// What the damping and friction of a body's joints do to it now, and no more than would stop it in
/// `steady_s`: a copy has it for so long.
struct JointResistance {
  Vec3 force = Vec3::Zero();   // N, in W
  Vec3 torque = Vec3::Zero();  // N m, in W
};
JointResistance ResistanceOfJoints(const Scene& scene, std::span<const BodyState> states,
                                   std::size_t body, double steady_s);

}  // namespace rikiseki::world
