// SPDX-License-Identifier: MIT
#include "world_server/geometry/convex_hull.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <random>

namespace rikiseki::world {
namespace {

// Convex, closed, holds every point, and made of them.
void RequireHull(const TriangleMesh& hull, const std::vector<Vec3>& points) {
  REQUIRE(hull.flaws().closed());
  REQUIRE(hull.Volume() > 0);
  // Euler: corners - edges + faces = 2, with 3/2 edges per face.
  REQUIRE(2 * hull.corners().size() == hull.faces().size() + 4);
  for (const TriangleMesh::Face& face : hull.faces()) {
    for (const Vec3& point : points) {
      REQUIRE(face.normal.dot(point - hull.corners()[face.corners[0]]) <= 1e-11 * hull.size());
    }
  }
  for (const Vec3& corner : hull.corners()) {
    REQUIRE(std::find(points.begin(), points.end(), corner) != points.end());
  }
}

}  // namespace

TEST_CASE("hulls of random points, of points on a sphere, and of grids") {
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  for (const int count : {4, 5, 20, 300}) {
    std::vector<Vec3> cloud, ball, thin;
    for (int i = 0; i < count; ++i) {
      const Vec3 p(normal(random), normal(random), normal(random));
      cloud.push_back(p);
      ball.push_back(0.05 * p.normalized() + Vec3(3, 0, 0));
      thin.push_back({p.x(), p.y(), 1e-4 * p.z()});
    }
    RequireHull(ConvexHull(cloud), cloud);
    RequireHull(ConvexHull(ball), ball);
    CHECK(ConvexHull(ball).corners().size() == ball.size());
    RequireHull(ConvexHull(thin), thin);
  }
  // Many points in each face, on each edge: only the corners count.
  std::vector<Vec3> grid;
  for (int i = 0; i < 9 * 9 * 9; ++i) grid.push_back(0.1 * Vec3(i % 9, i / 9 % 9, i / 81));
  const TriangleMesh cube = ConvexHull(grid);
  RequireHull(cube, grid);
  CHECK(cube.corners().size() == 8);
  CHECK(cube.Volume() == Approx(0.512).epsilon(1e-12));
  // A turned one, where points of a face are no longer exactly in a plane.
  const Quat turn = Quat(0.3, -0.5, 0.2, 0.8).normalized();
  for (Vec3& p : grid) p = turn * p;
  const TriangleMesh turned = ConvexHull(grid);
  CHECK(turned.flaws().closed());
  CHECK(turned.Volume() == Approx(0.512).epsilon(1e-10));
}

TEST_CASE("the hull of a cylinder's points has its volume") {
  std::vector<Vec3> points;
  const int n = 64;
  for (int i = 0; i < n; ++i) {
    const double a = 2 * 3.14159265358979323846 * i / n;
    for (const double z : {-0.1, 0.0, 0.1}) points.push_back({std::cos(a), std::sin(a), z});
  }
  const TriangleMesh hull = ConvexHull(points);
  const double area = n / 2.0 * std::sin(2 * 3.14159265358979323846 / n);
  CHECK(hull.flaws().closed());
  CHECK(hull.corners().size() == 2 * n);
  CHECK(hull.Volume() == Approx(0.2 * area).epsilon(1e-12));
}

TEST_CASE("points without an inside have no hull") {
  const std::vector<Vec3> flat = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}, {0.3, 0.2, 0}};
  CHECK_THROWS_AS(ConvexHull(flat), std::invalid_argument);
  CHECK_THROWS_AS(ConvexHull(std::vector<Vec3>(5, Vec3(1, 2, 3))), std::invalid_argument);
  CHECK_THROWS_AS(ConvexHull(std::vector<Vec3>{{0, 0, 0}, {1, 0, 0}}), std::invalid_argument);
  CHECK_THROWS_AS(
      ConvexHull(std::vector<Vec3>{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, std::nan("")}}),
      std::invalid_argument);
}

}  // namespace rikiseki::world
