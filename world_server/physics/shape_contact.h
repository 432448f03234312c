// SPDX-License-Identifier: MIT
// Where two shapes touch or would touch, whatever they are: the one question that the engine and the
// local copies ask, and which routine answers it.
#pragma once

#include <vector>

#include "world_server/physics/contact_point.h"
#include "world_server/physics/solid.h"

namespace rikiseki::world {

/// All points with a gap of at most `reach_m`, on the first shape, normals out of the second; at most
/// kMostContactPoints for two convex shapes. The first is neither a half-space nor a mesh unless the
/// second is convex.
std::vector<ContactPoint> FindShapeContact(const Solid& first, const Pose& pose_WF,
                                           const Solid& second, const Pose& pose_WS,
                                           double reach_m);

}  // namespace rikiseki::world
