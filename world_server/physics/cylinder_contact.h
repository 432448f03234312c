// SPDX-License-Identifier: MIT
// Where a cylinder touches or would touch a box. On a flat face it stands on eight
// points of its rim that are fixed in it, so that contacts persist while it slides; on its side it
// lies on the two ends of a line; tilted, on the lowest point of its rim. Points with a gap belong to
// it, so that a contact is known before it closes.
#pragma once

#include <vector>

#include "world_server/physics/contact_point.h"
#include "world_server/scene/scene.h"

namespace rikiseki::world {

/// Those with a gap of at most `reach_m`; empty where the two pass each other. Separating axes: faces,
/// edges against the side, edges against the rim.
std::vector<ContactPoint> FindCylinderBoxContact(const Cylinder& cylinder, const Pose& pose_WC,
                                                 const Box& box, const Pose& pose_WB,
                                                 double reach_m);

}  // namespace rikiseki::world
