// SPDX-License-Identifier: MIT
#include "world_server/geometry/triangle_mesh.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "tests/world_server/meshes.h"

namespace rikiseki::world {

TEST_CASE("corners at one place are one, and each edge knows both its triangles") {
  const TriangleMesh box = test::Build(test::BoxMesh({1, 2, 3}));
  CHECK(box.corners().size() == 8);
  CHECK(box.faces().size() == 12);
  CHECK(box.flaws().closed());
  CHECK(box.size() == Approx(2 * std::sqrt(14)));
  CHECK(box.radius() == Approx(std::sqrt(14)));
  for (std::uint32_t face = 0; face < 12; ++face) {
    for (const std::uint32_t neighbour : box.faces()[face].neighbours) {
      REQUIRE(neighbour < 12);
      const auto& back = box.faces()[neighbour].neighbours;
      CHECK(std::find(back.begin(), back.end(), face) != back.end());
    }
  }
  // Angle-weighted: at each corner of a box the three faces count alike, however they are cut.
  for (std::uint32_t corner = 0; corner < 8; ++corner) {
    const Vec3 expected = box.corners()[corner].cwiseSign() / std::sqrt(3);
    CHECK((box.corner_normal(corner) - expected).norm() < 1e-14);
  }
}

TEST_CASE("what is wrong with a mesh is counted") {
  test::RawMesh raw = test::BoxMesh({1, 1, 1});
  raw.triangles.push_back({0, 0, 1});
  CHECK(test::Build(raw).flaws().flat_triangles == 1);
  CHECK(test::Build(raw).flaws().closed());
  raw.triangles.erase(raw.triangles.begin());
  CHECK(test::Build(raw).flaws().open_edges == 3);
  CHECK_FALSE(test::Build(raw).flaws().closed());
  raw = test::BoxMesh({1, 1, 1});
  std::swap(raw.triangles[0][0], raw.triangles[0][1]);
  CHECK(test::Build(raw).flaws().twisted_edges == 3);
  raw = test::BoxMesh({1, 1, 1});
  for (Triangle& triangle : raw.triangles) std::swap(triangle[0], triangle[1]);
  CHECK(test::Build(raw).Volume() == Approx(-8));
  CHECK_THROWS_AS(TriangleMesh(raw.corners, std::vector<Triangle>{{0, 1, 1000}}),
                  std::invalid_argument);
  CHECK_THROWS_AS(TriangleMesh(raw.corners, std::vector<Triangle>{{0, 1, 1}}),
                  std::invalid_argument);
}

}  // namespace rikiseki::world
