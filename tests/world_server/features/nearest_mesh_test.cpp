// SPDX-License-Identifier: MIT
#include "world_server/features/nearest_mesh.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <random>

#include "tests/world_server/meshes.h"
#include "world_server/features/nearest_primitives.h"
#include "world_server/geometry/convex_hull.h"

namespace rikiseki::world {
namespace {

using test::Build;
using test::RawMesh;
using Vec3L = Eigen::Matrix<long double, 3, 1>;

constexpr double kRelative = 1e-9;

// Independent of the code under test: every triangle, in long double, by planes and segments; inside
// by the solid angle that the surface fills (van Oosterom & Strackee 1983).
struct BruteForce {
  explicit BruteForce(const RawMesh& raw) {
    for (const Triangle& triangle : raw.triangles) {
      for (const std::uint32_t corner : triangle) {
        corners.push_back(raw.corners[corner].cast<long double>());
      }
    }
  }

  static long double ToSegment(const Vec3L& a, const Vec3L& b, const Vec3L& p) {
    const Vec3L ab = b - a;
    const long double t = ab.dot(p - a) / ab.dot(ab);
    return (a + std::min(1.0L, std::max(0.0L, t)) * ab - p).norm();
  }

  long double Distance(const Vec3& point) const {
    const Vec3L p = point.cast<long double>();
    long double least = std::numeric_limits<long double>::infinity();
    long double solid_angle = 0;
    for (std::size_t i = 0; i < corners.size(); i += 3) {
      const Vec3L &a = corners[i], &b = corners[i + 1], &c = corners[i + 2];
      least = std::min({least, ToSegment(a, b, p), ToSegment(b, c, p), ToSegment(c, a, p)});
      const Vec3L across = (b - a).cross(c - a);
      const bool over = across.dot((b - a).cross(p - a)) >= 0 &&
                        across.dot((c - b).cross(p - b)) >= 0 &&
                        across.dot((a - c).cross(p - c)) >= 0;
      if (over) least = std::min(least, std::abs(across.dot(p - a)) / across.norm());
      const Vec3L ra = a - p, rb = b - p, rc = c - p;
      const long double la = ra.norm(), lb = rb.norm(), lc = rc.norm();
      solid_angle += 2 * std::atan2(ra.dot(rb.cross(rc)), la * lb * lc + ra.dot(rb) * lc +
                                                              rb.dot(rc) * la + rc.dot(ra) * lb);
    }
    return std::abs(solid_angle) > 2 * std::numbers::pi_v<long double> ? -least : least;
  }

  std::vector<Vec3L> corners;
};

RawMesh RandomHullOf(int count, std::mt19937& random) {
  std::normal_distribution<double> normal;
  RawMesh raw;
  for (int i = 0; i < count; ++i) {
    raw.corners.push_back(0.1 * Vec3(normal(random), 0.6 * normal(random), 1.5 * normal(random)));
  }
  const TriangleMesh hull = ConvexHull(raw.corners);
  raw.corners = hull.corners();
  for (const TriangleMesh::Face& face : hull.faces()) raw.triangles.push_back(face.corners);
  return raw;
}

// A torus with dents and horns: far from convex, its corners sharp both ways.
RawMesh Spiky() {
  RawMesh raw = test::Torus(0.1, 0.05, 24, 16);
  for (std::size_t i = 0; i < raw.corners.size(); ++i) {
    // The same corner comes from several quads: what moves it may depend on its place alone.
    const Vec3 c = raw.corners[i];
    raw.corners[i] *= 1 + 0.15 * std::sin(60 * c.x() + 30 * c.z()) * std::cos(50 * c.y());
  }
  return raw;
}

std::vector<RawMesh> Solids() {
  std::mt19937 random(11);
  return {test::BoxMesh({0.03, 0.05, 0.08}), test::CornerMesh(),
          test::Torus(0.1, 0.04, 24, 12),    Spiky(),
          RandomHullOf(60, random),          RandomHullOf(4, random)};
}

// Anywhere, and on and about faces, edges and corners, on both sides.
std::vector<Vec3> Probes(const RawMesh& raw, std::mt19937& random) {
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::vector<Vec3> probes;
  for (int i = 0; i < 150; ++i) {
    probes.push_back(0.25 * Vec3(uniform(random), uniform(random), uniform(random)));
    const Triangle& t = raw.triangles[random() % raw.triangles.size()];
    const Vec3 &a = raw.corners[t[0]], &b = raw.corners[t[1]], &c = raw.corners[t[2]];
    const double s = std::abs(uniform(random));
    const Vec3 normal = (b - a).cross(c - a).normalized();
    for (const double off : {0.0, 1e-12, 1e-9, 1e-6, 1e-3, -1e-9, -1e-6, -1e-3}) {
      probes.push_back(a + off * normal);
      probes.push_back(a + s * (b - a) + off * normal);
      probes.push_back(a + s * (b - a) + (1 - s) * 0.5 * (c - a) + off * normal);
    }
  }
  return probes;
}

}  // namespace

TEST_CASE("a mesh's nearest point is that of brute force, outside, on the surface and inside") {
  std::mt19937 random(3);
  for (const RawMesh& raw : Solids()) {
    const TriangleMesh mesh = Build(raw);
    CHECK(mesh.flaws().closed());
    const BruteForce brute(raw);
    for (const Vec3& p : Probes(raw, random)) {
      const NearestPoint nearest = FindNearest(mesh, p);
      const auto expected = static_cast<double>(brute.Distance(p));
      CAPTURE(mesh.faces().size(), p.transpose(), nearest.point.transpose(), expected);
      REQUIRE(nearest.point.allFinite());
      REQUIRE(nearest.normal.norm() == Approx(1).epsilon(1e-12));
      const double scale = mesh.size() + std::abs(expected);
      // On the surface itself the sign is that of rounding.
      const double distance =
          std::abs(expected) < 1e-15 ? std::abs(nearest.distance) : nearest.distance;
      REQUIRE(std::abs(distance - expected) <= kRelative * scale);
      REQUIRE((nearest.point + nearest.distance * nearest.normal - p).norm() <= kRelative * scale);
      REQUIRE(std::abs(static_cast<double>(brute.Distance(nearest.point))) <= kRelative * scale);
    }
  }
}

TEST_CASE("a box of triangles is a box, and so is the hull of its corners") {
  const Box box{{0.03, 0.05, 0.08}};
  const TriangleMesh mesh = Build(test::BoxMesh(box.half_extents));
  const TriangleMesh hull = ConvexHull(mesh.corners());
  CHECK(mesh.Volume() == Approx(8 * 0.03 * 0.05 * 0.08).epsilon(1e-14));
  CHECK(hull.Volume() == Approx(8 * 0.03 * 0.05 * 0.08).epsilon(1e-14));
  std::mt19937 random(4);
  std::uniform_real_distribution<double> uniform(-0.1, 0.1);
  for (int i = 0; i < 3000; ++i) {
    const Vec3 p(uniform(random), uniform(random), uniform(random));
    const NearestPoint exact = FindNearest(box, p);
    for (const TriangleMesh* triangles : {&mesh, &hull}) {
      const NearestPoint nearest = FindNearest(*triangles, p);
      REQUIRE(std::abs(nearest.distance - exact.distance) < 1e-15);
      REQUIRE((nearest.point - exact.point).norm() < 1e-15);
      REQUIRE((nearest.normal - exact.normal).norm() < 1e-9);
      REQUIRE_FALSE(nearest.degenerate);
    }
  }
}

TEST_CASE("on medial planes, at edges and at corners a mesh says that the normal is not unique") {
  const TriangleMesh box = Build(test::BoxMesh({0.03, 0.05, 0.08}));
  CHECK(FindNearest(box, Vec3(0, 0.01, 0.01)).degenerate);     // the middle
  CHECK(FindNearest(box, Vec3(0.02, 0.04, 0.01)).degenerate);  // as near to two faces
  CHECK(FindNearest(box, Vec3(0.03, 0.05, 0.01)).degenerate);  // an edge
  CHECK(FindNearest(box, Vec3(0.03, 0.05, 0.08)).degenerate);  // a corner
  CHECK_FALSE(FindNearest(box, Vec3(0.01, 0.01, 0.01)).degenerate);
  CHECK_FALSE(FindNearest(box, Vec3(0.03, 0.01, 0.01)).degenerate);
  // Over the diagonal of a face, where two triangles share the foot.
  CHECK_FALSE(FindNearest(box, Vec3(0.04, 0, 0)).degenerate);
  const TriangleMesh torus = Build(test::Torus(0.1, 0.04, 24, 12));
  CHECK(FindNearest(torus, Vec3::Zero()).degenerate);
  const NearestPoint twice[] = {FindNearest(torus, Vec3::Zero()), FindNearest(torus, Vec3::Zero())};
  CHECK(twice[0].normal == twice[1].normal);
}

TEST_CASE("extreme points: a finger at 1e8 m, denormal penetration") {
  for (const RawMesh& raw : Solids()) {
    const TriangleMesh mesh = Build(raw);
    for (const Vec3& p : {Vec3(1e8, -1e8, 3e7), Vec3(1e-310, 0, 0), Vec3(0, -1e-310, 1e-310)}) {
      const NearestPoint nearest = FindNearest(mesh, p);
      CHECK(std::isfinite(nearest.distance));
      CHECK(nearest.normal.norm() == Approx(1).epsilon(1e-12));
      CHECK((nearest.point + nearest.distance * nearest.normal - p).norm() <=
            kRelative * (1 + p.norm()));
    }
  }
}

TEST_CASE("the corner of an L-shaped mesh is felt like two boxes") {
  // With an upright wall both parts are boxes, which reach through each other.
  const RawMesh raw =
      test::Prism({{0, 0}, {0, 0.2}, {-0.1, 0.2}, {-0.1, -0.1}, {0.3, -0.1}, {0.3, 0}}, 0.2);
  const TriangleMesh mesh = Build(raw);
  REQUIRE(mesh.flaws().closed());
  const Box floor{{0.2, 0.2, 0.05}};
  const Vec3 floor_centre(0.1, 0, -0.05);
  const Box wall{{0.05, 0.2, 0.15}};
  const Vec3 wall_centre(-0.05, 0, 0.05);
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(0, 1);
  std::vector<NearestPoint> found;
  for (int i = 0; i < 4000; ++i) {
    // In front of both; beneath the floor's surface; in the wall; in both.
    const double x = (i % 2 == 0 ? 0.03 : -0.03) * uniform(random);
    const double z = (i / 2 % 2 == 0 ? 0.03 : -0.03) * uniform(random);
    const Vec3 p(x, 0.1 * (uniform(random) - 0.5), z);
    FindMeshFeatures(mesh, p, 0.05, found);
    CAPTURE(p.transpose(), found.size());
    // Deep in one part of the solid, beside the other one's end, the other box alone would push out of
    // its own hidden face; the mesh has no such face.
    const bool hidden = (x < 0 && z > 0) || (x > 0 && z < 0);
    for (const auto& [box, centre] :
         {std::pair(floor, floor_centre), std::pair(wall, wall_centre)}) {
      NearestPoint expected = FindNearest(box, p - centre);
      expected.point += centre;
      const bool face = std::abs(expected.normal.cwiseAbs().maxCoeff() - 1) < 1e-12;
      if (hidden && !face) continue;
      const bool seen = std::any_of(found.begin(), found.end(), [&](const NearestPoint& feature) {
        return (feature.normal - expected.normal).norm() <= kRelative &&
               std::abs(feature.distance - expected.distance) <= kRelative &&
               (feature.point - expected.point).norm() <= kRelative;
      });
      REQUIRE(seen);
    }
    REQUIRE(found.size() == 2);
  }
}

TEST_CASE("features are the minima of the distance: complete, nearest first, capped") {
  std::mt19937 random(6);
  std::uniform_real_distribution<double> uniform(-0.2, 0.2);
  const RawMesh raw = Spiky();
  const TriangleMesh mesh = Build(raw);
  std::vector<NearestPoint> found;
  std::size_t most = 0;
  for (int i = 0; i < 500; ++i) {
    const Vec3 p(uniform(random), uniform(random), uniform(random));
    const NearestPoint nearest = FindNearest(mesh, p);
    const double radius = 0.06;
    FindMeshFeatures(mesh, p, radius, found);
    REQUIRE(found.empty() == (nearest.distance > radius));
    if (found.empty()) continue;
    most = std::max(most, found.size());
    REQUIRE(found.size() <= kMaxFeatures);
    if (nearest.distance < 0) continue;
    CHECK(found[0].distance == nearest.distance);
    for (std::size_t j = 0; j < found.size(); ++j) {
      REQUIRE(found[j].distance <= radius);
      if (j > 1) REQUIRE(found[j].distance >= found[j - 1].distance);
      // Every triangle near the foot is at least as far: it is a minimum.
      for (const TriangleMesh::Face& face : mesh.faces()) {
        for (const double s : {0.3, 0.6}) {
          const Vec3 on = mesh.corners()[face.corners[0]] * (1 - s) +
                          mesh.corners()[face.corners[1]] * s * 0.5 +
                          mesh.corners()[face.corners[2]] * s * 0.5;
          const Vec3 close = found[j].point + 1e-4 * (on - found[j].point);
          const bool touches = std::abs(FindNearest(mesh, close).distance) < 1e-12;
          if (touches) REQUIRE((close - p).norm() >= found[j].distance - 1e-12);
        }
      }
    }
  }
  CHECK(most >= 3);
}

TEST_CASE("cones of normals leave no minimum out") {
  // Against all triangles one by one: a foot inside a triangle, seen from its front, is a minimum.
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(-0.2, 0.2);
  for (const RawMesh& raw : Solids()) {
    const TriangleMesh mesh = Build(raw);
    std::vector<NearestPoint> found;
    for (int i = 0; i < 300; ++i) {
      const Vec3 p(uniform(random), uniform(random), uniform(random));
      if (FindNearest(mesh, p).distance < 0) continue;
      const double radius = 0.1;
      FindMeshFeatures(mesh, p, radius, found);
      if (found.size() == kMaxFeatures) continue;
      for (const TriangleMesh::Face& face : mesh.faces()) {
        const Vec3 &a = mesh.corners()[face.corners[0]], &b = mesh.corners()[face.corners[1]],
                   &c = mesh.corners()[face.corners[2]];
        const double height = face.normal.dot(p - a);
        const bool over = face.normal.dot((b - a).cross(p - a)) > 1e-9 &&
                          face.normal.dot((c - b).cross(p - b)) > 1e-9 &&
                          face.normal.dot((a - c).cross(p - c)) > 1e-9;
        if (!over || height < 0 || height > radius) continue;
        const bool covered = std::any_of(found.begin(), found.end(), [&](const NearestPoint& near) {
          return near.normal.dot(face.normal) > 0.996 && near.distance <= height + 1e-12;
        });
        CAPTURE(p.transpose(), height, found.size());
        REQUIRE(covered);
      }
    }
  }
}

TEST_CASE("an open mesh has an inside only behind its own triangles") {
  RawMesh sheet;
  sheet.AddQuad({-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0});
  const TriangleMesh mesh = Build(sheet);
  CHECK(mesh.flaws().open_edges == 4);
  CHECK(FindNearest(mesh, Vec3(0.2, 0.1, 0.5)).distance == 0.5);
  CHECK(FindNearest(mesh, Vec3(0.2, 0.1, -0.01)).distance == -0.01);
  CHECK(FindNearest(mesh, Vec3(1.3, 0, -0.4)).distance == Approx(0.5));
  std::vector<NearestPoint> found;
  FindMeshFeatures(mesh, Vec3(0.2, 0.1, -0.01), 0.05, found);
  CHECK(found.size() == 1);
  FindMeshFeatures(mesh, Vec3(0.2, 0.1, -0.3), 0.05, found);
  CHECK(found.empty());
}

}  // namespace rikiseki::world
