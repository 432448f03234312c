// SPDX-License-Identifier: MIT
#include "world_server/geometry/polyhedron.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <random>

#include "tests/world_server/meshes.h"
#include "world_server/geometry/convex_hull.h"

namespace rikiseki::world {
namespace {

// Euler's formula, and every face a loop of corners in its plane with all others behind it.
void CheckClosed(const Polyhedron& body, double size) {
  CHECK(body.corners.size() + body.faces.size() == body.edges.size() + 2);
  std::size_t sides = 0;
  for (const Polyhedron::Face& face : body.faces) {
    REQUIRE(face.corners.size() >= 3);
    sides += face.corners.size();
    for (const Vec3& corner : body.corners) {
      REQUIRE(face.normal.dot(corner) < face.offset + 2e-6 * size);
    }
    for (std::size_t i = 0; i < face.corners.size(); ++i) {
      const Vec3& here = body.corners[face.corners[i]];
      const Vec3& next = body.corners[face.corners[(i + 1) % face.corners.size()]];
      REQUIRE(std::abs(face.normal.dot(here) - face.offset) < 2e-6 * size);
      // Inside is on the left, seen from outside.
      const Vec3 inward = face.normal.cross(next - here);
      for (const std::uint32_t other : face.corners) {
        REQUIRE(inward.dot(body.corners[other] - here) > -1e-9 * size * size);
      }
    }
  }
  CHECK(sides == 2 * body.edges.size());
}

}  // namespace

TEST_CASE("the triangles of a flat face are one polygon") {
  const Polyhedron box(ConvexHull(test::Build(test::BoxMesh({0.03, 0.02, 0.01})).corners()));
  CHECK(box.corners.size() == 8);
  CHECK(box.faces.size() == 6);
  CHECK(box.edges.size() == 12);
  CheckClosed(box, 0.1);

  std::vector<Vec3> rim;
  for (int i = 0; i < 24; ++i) {
    for (const double z : {-0.02, 0.02}) {
      rim.emplace_back(0.03 * std::cos(i * M_PI / 12), 0.03 * std::sin(i * M_PI / 12), z);
    }
  }
  const Polyhedron pillar(ConvexHull(rim));
  CHECK(pillar.faces.size() == 26);
  CHECK(pillar.edges.size() == 72);
  CheckClosed(pillar, 0.1);
}

TEST_CASE("points without order give a closed body of triangles") {
  std::mt19937 random(4);
  std::normal_distribution<double> any;
  std::vector<Vec3> points;
  for (int i = 0; i < 60; ++i) {
    points.push_back(0.03 * Vec3(any(random), any(random), any(random)).normalized());
  }
  const Polyhedron body(ConvexHull(points));
  CHECK(body.corners.size() == 60);
  CHECK(body.faces.size() == 116);
  CheckClosed(body, 0.06);
}

}  // namespace rikiseki::world
