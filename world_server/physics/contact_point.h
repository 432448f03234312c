// SPDX-License-Identifier: MIT
// A place where two shapes touch or would touch: what every contact routine of this folder finds.
#pragma once

#include <vector>

#include "common/geometry.h"

namespace rikiseki::world {

struct ContactPoint {
  Vec3 point_W = Vec3::Zero();    // m, of the first shape
  Vec3 normal_W = Vec3::UnitZ();  // unit, out of the second shape
  double gap = 0;                 // m, along the normal; < 0 = penetration
  double radius = 0;              // m, of the first shape's rounding there; 0 = a corner
};

inline constexpr std::size_t kMostContactPoints = 8;  // of one pair of shapes

/// Leaves at most that many of points that go round a polygon: every n-th, always the same while it
/// does not change, and the deepest where that is deeper than they are.
void KeepSome(std::vector<ContactPoint>& points);

/// Of points that were found in a frame of their own.
void PutInWorld(const Pose& pose_WF, std::vector<ContactPoint>& points);

}  // namespace rikiseki::world
