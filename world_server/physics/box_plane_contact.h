// SPDX-License-Identifier: MIT
// Where a box touches or would touch a half-space: at the corners of its lowest face.
#pragma once

#include <vector>

#include "world_server/physics/contact_point.h"
#include "world_server/scene/scene.h"

namespace rikiseki::world {

/// Against the half-space normal . x <= offset (unit normal, W).
std::vector<ContactPoint> FindBoxPlaneContact(const Box& box, const Pose& pose_WB,
                                              const Vec3& normal_W, double offset_m,
                                              double reach_m);

}  // namespace rikiseki::world
