// SPDX-License-Identifier: MIT
#include "world_server/physics/hull_contact.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "tests/world_server/meshes.h"
#include "tests/world_server/physics/contact_trials.h"
#include "world_server/geometry/convex_hull.h"
#include "world_server/physics/box_box_contact.h"

namespace rikiseki::world {
namespace {

using test::LeastGap;

const Box kBrick{{0.03, 0.025, 0.02}};
const Box kTable{{0.2, 0.2, 0.05}};

const Polyhedron& Brick() {
  static const Polyhedron brick(
      ConvexHull(test::Build(test::BoxMesh(kBrick.half_extents)).corners()));
  return brick;
}

// 40 points on an ellipsoid.
const Polyhedron& Pebble() {
  static const Polyhedron pebble = [] {
    std::vector<Vec3> points;
    for (int i = 0; i < 40; ++i) {
      const double z = (2 * i + 1) / 40.0 - 1;
      const double angle = 2.4 * i;
      const double across = std::sqrt(1 - z * z);
      points.emplace_back(0.04 * across * std::cos(angle), 0.03 * across * std::sin(angle),
                          0.025 * z);
    }
    return Polyhedron(ConvexHull(points));
  }();
  return pebble;
}

}  // namespace

TEST_CASE("a hull stands on the corners of its lower face") {
  const Pose pose{{0.05, -0.02, 0.071}, Quat(Eigen::AngleAxisd(0.3, Vec3::UnitZ()))};
  for (const auto& points : {FindHullPlaneContact(Brick(), pose, Vec3::UnitZ(), 0.05, 0.01),
                             FindHullBoxContact(Brick(), pose, kTable, {}, 0.01)}) {
    REQUIRE(points.size() == 4);
    for (const ContactPoint& point : points) {
      CHECK((point.normal_W - Vec3::UnitZ()).norm() < 1e-12);
      CHECK(point.gap == Approx(0.001).margin(1e-12));
      const Vec3 local = pose.Inverse() * point.point_W;
      CHECK((local.cwiseAbs() - kBrick.half_extents).norm() < 1e-12);
      CHECK(local.z() < 0);
    }
  }
  CHECK(FindHullPlaneContact(Brick(), pose, Vec3::UnitZ(), 0.05, 0.0009).empty());
  CHECK(FindHullBoxContact(Brick(), pose, kTable, {}, 0.0009).empty());
}

TEST_CASE("a hull is as near to a half-space as its lowest corner") {
  for (int i = 0; i < 50; ++i) {
    const Pose pose{{0, 0, 0.03},
                    Quat(Eigen::AngleAxisd(0.2 * i, Vec3(1, 0.1 * i, 0.3).normalized()))};
    double lowest = 1;
    for (const Vec3& corner : Pebble().corners) lowest = std::min(lowest, (pose * corner).z());
    CHECK(LeastGap(FindHullPlaneContact(Pebble(), pose, Vec3::UnitZ(), 0, 0.05)) ==
          Approx(lowest).margin(1e-12));
  }
}

// The two routines find their axes in different ways.
TEST_CASE("a hull of a box's corners meets a box as the box does") {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> any(-1, 1);
  int met = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    const auto vector = [&] { return Vec3(any(random), any(random), any(random)); };
    const auto turn = [&] {
      return Quat(any(random), any(random), any(random), any(random)).normalized();
    };
    const Box other{Vec3::Constant(0.03) + 0.02 * vector()};
    const Pose pose{0.08 * vector(), turn()};
    const Pose pose_O{0.02 * vector(), turn()};
    const auto as_box = FindBoxBoxContact(kBrick, pose, other, pose_O, 0.01);
    const auto as_hull = FindHullBoxContact(Brick(), pose, other, pose_O, 0.01);
    CAPTURE(trial);
    if (as_box.empty() || as_hull.empty()) continue;
    // Where two axes are equal to 1e-3 of the size they may choose differently.
    if ((as_box[0].normal_W - as_hull[0].normal_W).norm() > 1e-9) continue;
    ++met;
    REQUIRE(LeastGap(as_hull) == Approx(LeastGap(as_box)).margin(1e-9));
  }
  CHECK(met > 500);
}

TEST_CASE("random hulls and boxes") {
  test::CheckRandomContacts(
      Pebble().thinnest,
      [](const Pose& pose, const Box& box, const Pose& pose_B, double reach) {
        return FindHullBoxContact(Pebble(), pose, box, pose_B, reach);
      },
      [](const Pose& pose, const Vec3& direction) {
        const Vec3 local = pose.orientation.conjugate() * direction;
        return pose * *std::ranges::max_element(Pebble().corners, {},
                                                [&](const Vec3& c) { return c.dot(local); });
      });
}

}  // namespace rikiseki::world
