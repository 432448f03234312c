// SPDX-License-Identifier: MIT
// A convex body by its flat faces: triangles that lie in one plane are one polygon.
#pragma once

#include <cstdint>
#include <vector>

#include "common/geometry.h"
#include "world_server/geometry/triangle_mesh.h"

namespace rikiseki::world {

struct Polyhedron {
  struct Face {
    Vec3 normal = Vec3::UnitZ();         // unit, outward
    double offset = 0;                   // normal . x of its plane
    std::vector<std::uint32_t> corners;  // counter-clockwise from outside
  };
  struct Edge {
    std::uint32_t from = 0, to = 0;     // corners
    std::uint32_t left = 0, right = 0;  // faces
  };

  std::vector<Vec3> corners;
  std::vector<Face> faces;
  std::vector<Edge> edges;
  double thinnest = 0;  // m, the smallest half extent of its bounds

  /// Of a closed convex mesh. A triangle belongs to a neighbour's plane from which its corners are at
  /// most 1e-6 of the mesh's size away.
  explicit Polyhedron(const TriangleMesh& hull);
};

}  // namespace rikiseki::world
