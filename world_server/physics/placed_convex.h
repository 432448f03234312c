// SPDX-License-Identifier: MIT
// A convex shape in its place as contact routines see it: a core - a point, a line, a box, ... - with
// a rounding round it; how far it reaches along a direction, and what of it may touch there.
#pragma once

#include <array>
#include <optional>
#include <variant>
#include <vector>

#include "world_server/physics/box_faces.h"
#include "world_server/physics/placed_cylinder.h"
#include "world_server/physics/solid.h"

namespace rikiseki::world {

/// Of a capsule the line between the middles of its caps; of a sphere both are its centre.
struct PlacedLine {
  Vec3 from, to;
};

struct PlacedEllipsoid {
  Vec3 centre;
  Mat3 axes;
  Vec3 radii;
};

struct PlacedHull {
  const Polyhedron* hull;
  Vec3 origin;
  Mat3 axes;
};

struct PlacedTriangle {
  std::array<Vec3, 3> corners;
  Vec3 normal;
};

struct FlatFace {
  Vec3 normal = Vec3::UnitZ();  // unit, out of the shape
  double offset = 0;            // normal . x of its plane
  Polygon border;               // counter-clockwise about the normal
};

class PlacedConvex {
 public:
  /// Neither a half-space nor a mesh. `solid` outlives this.
  PlacedConvex(const Solid& solid, const Pose& pose);
  explicit PlacedConvex(const PlacedTriangle& triangle);

  const Vec3& centre() const { return centre_; }
  double radius() const { return radius_; }      // m, of the rounding round the core
  double thinnest() const { return thinnest_; }  // m, the smallest half extent, rounding included

  /// Of the core the point that lies furthest along a direction.
  Vec3 Support(const Vec3& direction) const;

  /// What of the core may touch a plane that looks along `normal`: polygons, lines and points.
  std::vector<Polygon> Against(const Vec3& normal) const;

  /// Of those the points that lie furthest against `normal` or nearly: a line, or a point.
  Polygon LineAgainst(const Vec3& normal) const;

  /// The core's flat face that looks most along `direction`, if it has one.
  std::optional<FlatFace> FaceAlong(const Vec3& direction) const;

  /// The normals of its flat faces; of a hull of very many none.
  std::vector<Vec3> FaceNormals() const;

  /// Of the shape at a contact along `normal`: the radius of a ball that touches like it; 0 = a corner.
  double RoundingAgainst(const Vec3& normal) const;

 private:
  std::variant<PlacedLine, PlacedBox, PlacedCylinder, PlacedEllipsoid, PlacedHull, PlacedTriangle>
      core_;
  Vec3 centre_ = Vec3::Zero();
  double radius_ = 0;
  double thinnest_ = 0;
};

}  // namespace rikiseki::world
