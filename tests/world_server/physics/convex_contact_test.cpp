// SPDX-License-Identifier: MIT
#include "world_server/physics/convex_contact.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "tests/world_server/meshes.h"
#include "tests/world_server/physics/contact_trials.h"
#include "world_server/geometry/convex_hull.h"
#include "world_server/physics/shape_contact.h"

namespace rikiseki::world {
namespace {

const Quat kLyingAlongY(Eigen::AngleAxisd(std::numbers::pi / 2, Vec3::UnitX()));
const Quat kLyingAlongX(Eigen::AngleAxisd(std::numbers::pi / 2, Vec3::UnitY()));

Hull Stone() {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  std::vector<Vec3> corners;
  for (int i = 0; i < 30; ++i) {
    corners.push_back(0.03 * Vec3(normal(random), normal(random), normal(random)).normalized());
  }
  return {.mesh = std::make_shared<const TriangleMesh>(ConvexHull(corners))};
}

std::vector<ContactPoint> Find(const Shape& first, const Pose& pose_1, const Shape& second,
                               const Pose& pose_2, double reach) {
  return FindShapeContact(Solid(first), pose_1, Solid(second), pose_2, reach);
}

}  // namespace

// Bodies rest 1e-4 of their size deep; deeper the best axis near the best face is good enough.
TEST_CASE("any convex shape at any pose on any box: no axis is better, and no point is missing") {
  const Hull stone = Stone();
  for (const Shape& shape :
       {Shape(Cylinder{0.02, 0.03}), Shape(Capsule{0.02, 0.03}), Shape(Sphere{0.03}),
        Shape(Ellipsoid{{0.03, 0.02, 0.04}}), Shape(stone), Shape(Box{{0.02, 0.03, 0.04}})}) {
    const Solid solid(shape);
    CAPTURE(shape.index());
    test::CheckRandomContacts(
        0.01,
        [&](const Pose& pose, const Box& box, const Pose& pose_B, double reach) {
          const Solid other{Shape(box)};
          return FindConvexContact(PlacedConvex(solid, pose), PlacedConvex(other, pose_B), reach);
        },
        [&](const Pose& pose, const Vec3& direction) {
          const PlacedConvex placed(solid, pose);
          return Vec3(placed.Support(direction) + placed.radius() * direction);
        },
        /*deepest_m=*/2e-4);
  }
}

TEST_CASE("lines beside lines touch at both ends of what they share, crossed ones at one point") {
  const double r = 0.03;
  for (const Shape& shape : {Shape(Cylinder{r, 0.05}), Shape(Capsule{r, 0.05})}) {
    for (const Shape& other : {Shape(Cylinder{r, 0.05}), Shape(Capsule{r, 0.05})}) {
      for (const double gap : {-1e-5, 0.0, 1e-3}) {
        CAPTURE(shape.index(), other.index(), gap);
        const Pose above{{0, 0.02, 2 * r + gap}, kLyingAlongY};
        const auto beside = Find(shape, above, other, {{0, 0, 0}, kLyingAlongY}, 0.01);
        REQUIRE(beside.size() == 2);
        for (const ContactPoint& point : beside) {
          CHECK(point.gap == Approx(gap).margin(1e-12));
          CHECK((point.normal_W - Vec3::UnitZ()).norm() < 1e-9);
          CHECK(point.point_W.x() == Approx(0).margin(1e-9));
          CHECK(point.radius == r);
        }
        CHECK(std::min(beside[0].point_W.y(), beside[1].point_W.y()) == Approx(-0.03));
        CHECK(std::max(beside[0].point_W.y(), beside[1].point_W.y()) == Approx(0.05));

        const Pose across{{0.01, 0.02, 2 * r + gap}, kLyingAlongX};
        const auto crossed = Find(shape, across, other, {{0, 0, 0}, kLyingAlongY}, 0.01);
        REQUIRE(crossed.size() == 1);
        CHECK(crossed[0].gap == Approx(gap).margin(1e-12));
        CHECK((crossed[0].point_W - Vec3(0, 0.02, r + gap)).norm() < 1e-6);
        CHECK((crossed[0].normal_W - Vec3::UnitZ()).norm() < 1e-6);
      }
    }
  }
}

TEST_CASE("end on end, a cylinder stands on what both caps have in common") {
  for (const Shape& below : {Shape(Cylinder{0.03, 0.02}), Shape(Cylinder{0.06, 0.02})}) {
    for (const double offset : {0.0, 0.02}) {
      const auto found = Find(Cylinder{0.03, 0.02}, {.position = {offset, 0, 0.0401}}, below,
                              {.position = {0, 0, 0}}, 0.01);
      REQUIRE(found.size() >= 6);
      REQUIRE(found.size() <= kMostContactPoints);
      Bounds bounds;
      for (const ContactPoint& point : found) {
        CHECK(point.gap == Approx(1e-4).margin(1e-12));
        CHECK((point.normal_W - Vec3::UnitZ()).norm() < 1e-12);
        CHECK((point.point_W - Vec3(offset, 0, 0)).head<2>().norm() < 0.03 * (1 + 1e-9));
        bounds.Add(point.point_W);
      }
      const double radius = std::get<Cylinder>(below).radius;
      CHECK(bounds.high.x() == Approx(std::min(radius, offset + 0.03)).epsilon(0.03));
      CHECK(bounds.low.x() == Approx(std::max(-radius, offset - 0.03)).epsilon(0.03));
    }
  }
}

TEST_CASE("an ellipsoid touches a ball and a box where the nearest point is") {
  const Ellipsoid ellipsoid{{0.03, 0.02, 0.04}};
  std::mt19937 random(3);
  std::uniform_real_distribution<double> any(-1, 1);
  int met = 0;
  for (int i = 0; i < 300; ++i) {
    const Pose pose{0.1 * Vec3(any(random), any(random), any(random)),
                    Quat(any(random), any(random), any(random), any(random)).normalized()};
    // The generic routine and the exact nearest point of a ball must agree.
    const Solid ball{Shape(Sphere{0.02})};
    const Solid solid{Shape(ellipsoid)};
    const auto exact = FindShapeContact(solid, pose, ball, {}, 0.05);
    const auto found = FindConvexContact(PlacedConvex(solid, pose), PlacedConvex(ball, {}), 0.05);
    REQUIRE(found.size() == exact.size());
    if (exact.empty() || exact[0].gap < -0.01) continue;
    ++met;
    CHECK(found[0].gap == Approx(exact[0].gap).margin(1e-9));
    CHECK((found[0].normal_W - exact[0].normal_W).norm() < 1e-5);
    CHECK((found[0].point_W - exact[0].point_W).norm() < 1e-6);
  }
  CHECK(met > 50);
}

TEST_CASE("hull on hull as box on box: the same contacts, told by faces") {
  const Vec3 half(0.03, 0.02, 0.025);
  const TriangleMesh mesh = test::Build(test::BoxMesh(half));
  const Hull hull{.mesh = std::make_shared<const TriangleMesh>(mesh)};
  std::mt19937 random(9);
  std::uniform_real_distribution<double> any(-1, 1);
  int met = 0;
  for (int i = 0; i < 400; ++i) {
    const Vec3 tilt = (i % 2 == 0 ? 0.02 : 2) * Vec3(any(random), any(random), any(random));
    const Pose pose{{0.04 * any(random), 0.03 * any(random), 0.05 + 0.01 * any(random)},
                    Quat(Eigen::AngleAxisd(tilt.norm(), tilt.normalized()))};
    const auto boxes = Find(Box{half}, pose, Box{half}, {}, 0.01);
    const auto hulls = Find(hull, pose, hull, {}, 0.01);
    const double least = test::LeastGap(boxes);
    if (boxes.empty() || least < -1e-3) continue;
    ++met;
    CAPTURE(i, least);
    REQUIRE_FALSE(hulls.empty());
    // Where two axes are alike within the margin either may be taken.
    CHECK(test::LeastGap(hulls) == Approx(least).margin(4 * kEdgeMargin * 0.02));
    if (i % 2 == 0 && std::abs(least) < 5e-3) CHECK(hulls.size() == boxes.size());
  }
  CHECK(met > 100);
}

}  // namespace rikiseki::world
