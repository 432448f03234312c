// Where two boxes touch or would touch: separating axes, then the incident face clipped against the
// reference face. Points with a gap belong to it, so that a contact is known before it closes.
#pragma once

#include <vector>

#include "common/geometry.h"
#include "world_server/scene/scene.h"

namespace rikiseki::world {

struct BoxBoxPoint {
  Vec3 point_W = Vec3::Zero();    // m, of the first box
  Vec3 normal_W = Vec3::UnitZ();  // unit, out of the second box
  double gap = 0;                 // m, along the normal; < 0 = penetration
};

/// The support polygon of the two boxes, at most 8 points, or the one point where two edges meet;
/// those with a gap of at most `reach_m`. Empty where the boxes pass each other.
std::vector<BoxBoxPoint> FindBoxBoxContact(const Box& first, const Pose& pose_WF, const Box& second,
                                           const Pose& pose_WS, double reach_m);

}  // namespace rikiseki::world
