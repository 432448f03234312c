// SPDX-License-Identifier: MIT
// A box in its place, and polygons clipped against its faces: what the contact routines of boxes
// with boxes, cylinders and hulls share.
#pragma once

#include <vector>

#include "common/geometry.h"
#include "world_server/scene/scene.h"

namespace rikiseki::world {

/// Corners in order; two are a segment, one is a point.
using Polygon = std::vector<Vec3>;

/// Where shapes meet by a face within this part of the smallest half extent as well as by an edge,
/// the face is taken: what rocks by a hair still stands on its face.
inline constexpr double kEdgeMargin = 1e-3;

struct PlacedBox {
  Vec3 centre;
  Mat3 axes;
  Vec3 half;

  PlacedBox(const Box& box, const Pose& pose);

  /// Half the extent along a unit direction.
  double Extent(const Vec3& direction) const;

  /// The corner that lies furthest along a direction.
  Vec3 Corner(const Vec3& direction) const;

  /// The face that looks most against `normal`.
  Polygon FaceAgainst(const Vec3& normal) const;
};

/// What of the polygon lies on the inner side of the plane normal . x <= offset.
Polygon Clip(const Polygon& polygon, const Vec3& normal, double offset);

/// What of the polygon lies over the box's two faces along `axis`.
Polygon ClipToFace(Polygon polygon, const PlacedBox& box, int axis);

/// What of the polygon lies over a convex face: its border is counter-clockwise about `normal`.
Polygon ClipToBorder(Polygon polygon, const Polygon& border, const Vec3& normal);

/// The place on the line p + t along, |t| <= half, that is nearest to the line through q along
/// `other`. Unit directions that are not parallel.
Vec3 NearestOnSegment(const Vec3& p, const Vec3& along, double half, const Vec3& q,
                      const Vec3& other);

}  // namespace rikiseki::world
