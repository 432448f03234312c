// SPDX-License-Identifier: MIT
#include "world_server/scene/shape_size.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/overloaded.h"

namespace rikiseki::world {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();

Ball BallOf(const TriangleMesh& mesh) {
  return {.centre = (mesh.bounds().low + mesh.bounds().high) / 2, .radius = mesh.radius()};
}

// Of a convex mesh: to the nearest of its faces' planes.
double InnerRadiusOf(const TriangleMesh& hull) {
  double least = kInfinite;
  for (const TriangleMesh::Face& face : hull.faces()) {
    least = std::min(least, face.normal.dot(hull.corners()[face.corners[0]]));
  }
  return std::max(least, 0.0);
}

}  // namespace

Ball OuterBall(const Shape& shape) {
  return std::visit(
      Overloaded{
          [](const Box& box) { return Ball{.radius = box.half_extents.norm()}; },
          [](const Sphere& sphere) { return Ball{.radius = sphere.radius}; },
          [](const HalfSpace&) { return Ball{.radius = kInfinite}; },
          [](const Cylinder& c) { return Ball{.radius = std::hypot(c.radius, c.half_length)}; },
          [](const Capsule& c) { return Ball{.radius = c.radius + c.half_length}; },
          [](const Ellipsoid& e) { return Ball{.radius = e.radii.maxCoeff()}; },
          [](const Hull& hull) { return BallOf(*hull.mesh); },
          [](const Mesh& mesh) { return BallOf(*mesh.mesh); }},
      shape);
}

double InnerRadius(const Shape& shape) {
  return std::visit(
      Overloaded{[](const Box& box) { return box.half_extents.minCoeff(); },
                 [](const Sphere& sphere) { return sphere.radius; },
                 [](const HalfSpace&) { return kInfinite; },
                 [](const Cylinder& c) { return std::min(c.radius, c.half_length); },
                 [](const Capsule& capsule) { return capsule.radius; },
                 [](const Ellipsoid& ellipsoid) { return ellipsoid.radii.minCoeff(); },
                 [](const Hull& hull) { return InnerRadiusOf(*hull.mesh); },
                 [](const Mesh&) { return 0.0; }},
      shape);
}

}  // namespace rikiseki::world
