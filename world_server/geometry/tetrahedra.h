// SPDX-License-Identifier: MIT
// A solid divided into tetrahedra, for bodies that deform: boxes as regular grids, balls and ellipsoids
// as a rounded grid inside layers that follow the surface, so that no element is cut.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "common/geometry.h"
#include "world_server/geometry/triangle_mesh.h"

namespace rikiseki::world {

/// Corners of each in the order that gives it a positive volume.
using Tetrahedron = std::array<std::uint32_t, 4>;

struct TetrahedralMesh {
  std::vector<Vec3> nodes;
  std::vector<Tetrahedron> tetrahedra;

  double Volume() const;
};

/// Elements about as long as `edge_m` > 0 along each axis, at least one; neighbouring cells are mirror
/// images, so that the grid favours no direction.
TetrahedralMesh MeshBox(const Vec3& half_extents, double edge_m);

/// The ellipsoid with these radii; every outer node lies on it. Volume and elements are those of the
/// inscribed polyhedron.
TetrahedralMesh MeshEllipsoid(const Vec3& radii, double edge_m);

/// How many nodes those meshes have, without making them; as large as it gets where the count would
/// overflow.
double BoxNodeCount(const Vec3& half_extents, double edge_m);
double EllipsoidNodeCount(const Vec3& radii, double edge_m);

/// The faces that only one tetrahedron has, counter-clockwise seen from outside, in the order of the
/// tetrahedra.
std::vector<Triangle> SurfaceOf(const TetrahedralMesh& mesh);

}  // namespace rikiseki::world
