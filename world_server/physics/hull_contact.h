// SPDX-License-Identifier: MIT
// Where a convex hull touches or would touch a half-space or a box: the corners of the face that is
// turned to the other, clipped to the other's face, all at once; or the one point where two edges
// meet. Points with a gap belong to it, so that a contact is known before it closes.
#pragma once

#include <vector>

#include "world_server/geometry/polyhedron.h"
#include "world_server/physics/contact_point.h"
#include "world_server/scene/scene.h"

namespace rikiseki::world {

/// Against the half-space normal . x <= offset (unit normal, W).
std::vector<ContactPoint> FindHullPlaneContact(const Polyhedron& hull, const Pose& pose_WH,
                                               const Vec3& normal_W, double offset_m,
                                               double reach_m);

/// Those with a gap of at most `reach_m`; empty where the two pass each other.
std::vector<ContactPoint> FindHullBoxContact(const Polyhedron& hull, const Pose& pose_WH,
                                             const Box& box, const Pose& pose_WB, double reach_m);

}  // namespace rikiseki::world
