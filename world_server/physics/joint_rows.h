// SPDX-License-Identifier: MIT
// The geometry of joints: in which directions one holds two bodies, in which it lets them go, and
// how far they are apart there.
#pragma once

#include <vector>

#include "common/geometry.h"
#include "world_server/scene/scene.h"

namespace rikiseki::world {

/// A joint as each of its bodies carries it, in W.
struct JointFrames {
  Pose parent_WJ = {}, child_WJ = {};
  Vec3 parent_centre = Vec3::Zero(), child_centre = Vec3::Zero();  // of mass; anywhere if fixed
};

/// One direction: its rate is linear . (v_child - v_parent) + angular_child . w_child +
/// angular_parent . w_parent, with the velocities of the centres of mass. An impulse along it acts on
/// the two bodies with the same factors, and so keeps momentum and angular momentum.
struct JointRow {
  Vec3 linear = Vec3::Zero();
  Vec3 angular_child = Vec3::Zero();
  Vec3 angular_parent = Vec3::Zero();
  double position = 0;  // m or rad, whose rate this is
};

/// The directions that a joint holds: five, of a ball three. Their positions are to be 0.
void AppendHeldRows(Joint::Type type, const JointFrames& frames, std::vector<JointRow>& rows);

/// The one in which a revolute or prismatic joint moves; its position is the joint's, an angle within
/// -pi..pi.
JointRow FreeRow(Joint::Type type, const JointFrames& frames);

}  // namespace rikiseki::world
