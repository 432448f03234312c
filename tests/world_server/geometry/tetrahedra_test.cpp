// SPDX-License-Identifier: MIT
// Solids in tetrahedra: whole, closed, of the right volume, and no element worse than it must be.
#include "world_server/geometry/tetrahedra.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

namespace rikiseki::world {
namespace {

double VolumeOf(const TetrahedralMesh& mesh, const Tetrahedron& t) {
  const Vec3& a = mesh.nodes[t[0]];
  return (mesh.nodes[t[1]] - a).cross(mesh.nodes[t[2]] - a).dot(mesh.nodes[t[3]] - a) / 6;
}

// Smallest height over longest edge: 0.82 of a regular one, 0 of a flat one.
double WorstShape(const TetrahedralMesh& mesh) {
  double worst = 1;
  for (const Tetrahedron& t : mesh.tetrahedra) {
    double edge = 0, face = 0;
    for (std::size_t i = 0; i < 4; ++i) {
      for (std::size_t j = 0; j < i; ++j) {
        edge = std::max(edge, (mesh.nodes[t[i]] - mesh.nodes[t[j]]).norm());
        for (std::size_t k = 0; k < j; ++k) {
          face = std::max(face, (mesh.nodes[t[i]] - mesh.nodes[t[k]])
                                        .cross(mesh.nodes[t[j]] - mesh.nodes[t[k]])
                                        .norm() /
                                    2);
        }
      }
    }
    worst = std::min(worst, 3 * VolumeOf(mesh, t) / face / edge);
  }
  return worst;
}

// Its surface is a closed one that looks outward and holds the same volume.
void CheckSurface(const TetrahedralMesh& mesh) {
  const TriangleMesh surface(mesh.nodes, SurfaceOf(mesh));
  CHECK(surface.flaws().closed());
  CHECK(surface.flaws().flat_triangles == 0);
  CHECK(surface.Volume() == Approx(mesh.Volume()).epsilon(1e-12));
}

}  // namespace

TEST_CASE("a box in tetrahedra") {
  const Vec3 half(0.04, 0.05, 0.015);
  for (const double edge : {0.2, 0.02, 0.01}) {
    const TetrahedralMesh mesh = MeshBox(half, edge);
    CHECK(static_cast<double>(mesh.nodes.size()) == BoxNodeCount(half, edge));
    for (const Tetrahedron& t : mesh.tetrahedra) REQUIRE(VolumeOf(mesh, t) > 0);
    CHECK(mesh.Volume() == Approx(8 * half.prod()).epsilon(1e-12));
    CheckSurface(mesh);
  }
  CHECK(MeshBox(half, 0.01).tetrahedra.size() == 6 * 8 * 10 * 3);
  CHECK(WorstShape(MeshBox(half, 0.01)) == Approx(1 / std::sqrt(6.0)).epsilon(1e-9));
}

TEST_CASE("an ellipsoid in tetrahedra: outer nodes on it, and no sliver") {
  for (const Vec3& radii : {Vec3(0.03, 0.03, 0.03), Vec3(0.04, 0.03, 0.025)}) {
    double missing = 1;
    for (const double edge : {0.02, 0.01, 0.005}) {
      const TetrahedralMesh mesh = MeshEllipsoid(radii, edge);
      CHECK(static_cast<double>(mesh.nodes.size()) == EllipsoidNodeCount(radii, edge));
      for (const Tetrahedron& t : mesh.tetrahedra) REQUIRE(VolumeOf(mesh, t) > 0);
      CheckSurface(mesh);
      for (const Triangle& t : SurfaceOf(mesh)) {
        for (const std::uint32_t node : t) {
          REQUIRE(mesh.nodes[node].cwiseQuotient(radii).norm() == Approx(1).epsilon(1e-12));
        }
      }
      CHECK(WorstShape(mesh) > 0.1);
      // A polyhedron inside a ball misses volume in proportion to the square of its edges.
      const double whole = 4 * std::numbers::pi / 3 * radii.prod();
      const double now = 1 - mesh.Volume() / whole;
      CHECK(now > 0);
      CHECK(now < 0.5 * missing);
      missing = now;
    }
    CHECK(missing < 0.05);
  }
}

}  // namespace rikiseki::world
