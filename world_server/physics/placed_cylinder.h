// SPDX-License-Identifier: MIT
// A cylinder in its place: what of it may touch a plane. On a flat face it stands on eight points of
// its rim that are fixed in it, so that contacts persist while it slides; on its side it lies on the
// two ends of a line; tilted, on the lowest point of its rim.
#pragma once

#include <vector>

#include "world_server/physics/box_faces.h"

namespace rikiseki::world {

struct PlacedCylinder {
  Vec3 centre;
  Mat3 axes;
  Vec3 axis;
  double radius, half_length;

  PlacedCylinder(const Cylinder& cylinder, const Pose& pose);

  /// Half the extent along a unit direction.
  double Extent(const Vec3& direction) const;

  /// Of the cap that looks against `normal`: its place on the axis, -1 or 1.
  double CapSide(const Vec3& normal) const { return axis.dot(normal) > 0 ? -1 : 1; }

  /// The line of the side that lies furthest against `normal`, from the nearer cap to the other.
  Polygon Side(const Vec3& normal) const;

  double Sine(const Vec3& normal) const { return axis.cross(normal).norm(); }

  /// What of the cylinder may touch a face that looks along `normal`: polygons, lines and points.
  std::vector<Polygon> Against(const Vec3& normal) const;

  /// Where that is the side, lying flat on the face or nearly: the radius of the rounding; else 0.
  double RoundingAgainst(const Vec3& normal) const;

  /// A polygon round the cap that lies furthest along `direction`, a little larger than it;
  /// counter-clockwise about `direction`.
  Polygon RoundCap(const Vec3& direction) const;

 private:
  Polygon Cap(const Vec3& normal) const;
};

/// Tilted by more than this sine, a cap is far from landing.
inline constexpr double kOverCap = 0.2;
/// Tilted by less than this sine, the fixed points of a cap tell all but 1e-4 of the radius.
inline constexpr double kFlatCap = 1e-3;

}  // namespace rikiseki::world
