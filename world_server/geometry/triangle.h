// SPDX-License-Identifier: MIT
// The point of one triangle that is nearest to a point, and on which part of it that lies.
#pragma once

#include "common/geometry.h"

namespace rikiseki::world {

struct TriangleFoot {
  enum class Part { kFace, kEdge, kCorner };

  Vec3 point = Vec3::Zero();
  Vec3 weights =
      Vec3::UnitX();  // of the corners: point = sum of weight times corner; sum 1, each >= 0
  Part part = Part::kFace;
  int index = 0;  // of the edge (from corner i to i+1) or the corner
};

/// Everything finite. A triangle without an area has a foot on an edge or a corner.
TriangleFoot FootOnTriangle(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& p);

}  // namespace rikiseki::world
