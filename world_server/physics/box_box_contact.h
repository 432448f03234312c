// SPDX-License-Identifier: MIT
// Where two boxes touch or would touch: separating axes, then the incident face clipped against the
// reference face. Points with a gap belong to it, so that a contact is known before it closes.
#pragma once

#include <vector>

#include "world_server/physics/contact_point.h"
#include "world_server/scene/scene.h"

namespace rikiseki::world {

/// The support polygon of the two boxes, at most 8 points, or the one point where two edges meet;
/// those with a gap of at most `reach_m`. Empty where the boxes pass each other.
std::vector<ContactPoint> FindBoxBoxContact(const Box& first, const Pose& pose_WF,
                                            const Box& second, const Pose& pose_WS, double reach_m);

}  // namespace rikiseki::world
