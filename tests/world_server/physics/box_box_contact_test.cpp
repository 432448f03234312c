// SPDX-License-Identifier: MIT
#include "world_server/physics/box_box_contact.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <random>

namespace rikiseki::world {
namespace {

const Box kCube{Vec3::Constant(0.03)};
const double kEighth = M_PI / 4;

Quat About(const Vec3& axis, double angle) {
  return Quat(Eigen::AngleAxisd(angle, axis.normalized()));
}

double LeastGap(const std::vector<ContactPoint>& points) {
  double least = std::numeric_limits<double>::infinity();
  for (const ContactPoint& point : points) least = std::min(least, point.gap);
  return least;
}

// How far outside a box a place is, at most along one axis.
double Outside(const Box& box, const Pose& pose, const Vec3& point_W) {
  return ((pose.Inverse() * point_W).cwiseAbs() - box.half_extents).maxCoeff();
}

Vec3 NearestOf(const Box& box, const Pose& pose, const Vec3& point_W) {
  const Vec3 local = pose.Inverse() * point_W;
  return pose * Vec3(local.cwiseMax(-box.half_extents).cwiseMin(box.half_extents));
}

// By alternating projections, which converge between convex bodies: an upper bound, near the truth.
double Distance(const Box& a, const Pose& pose_a, const Box& b, const Pose& pose_b) {
  Vec3 on_a = pose_a.position;
  Vec3 on_b = pose_b.position;
  for (int i = 0; i < 3000; ++i) {
    on_b = NearestOf(b, pose_b, on_a);
    on_a = NearestOf(a, pose_a, on_b);
  }
  return (on_a - on_b).norm();
}

}  // namespace

TEST_CASE("a cube on a larger one: its four lower corners, the normal upward") {
  const Box table{{0.2, 0.2, 0.05}};
  for (const double gap : {0.004, 0.0, -0.002}) {
    const Pose cube{{0.05, -0.02, 0.08 + gap}, About(Vec3::UnitZ(), 0.3)};
    const auto points = FindBoxBoxContact(kCube, cube, table, {}, 0.01);
    REQUIRE(points.size() == 4);
    for (const ContactPoint& point : points) {
      CHECK((point.normal_W - Vec3::UnitZ()).norm() < 1e-12);
      CHECK(point.gap == Approx(gap).margin(1e-12));
      const Vec3 local = cube.Inverse() * point.point_W;
      CHECK((local.cwiseAbs() - kCube.half_extents).norm() < 1e-12);
      CHECK(local.z() < 0);
    }
  }
}

TEST_CASE("the larger one under the cube has its points where the cube's corners are") {
  const Box table{{0.2, 0.2, 0.05}};
  const Pose cube{{0.05, -0.02, 0.081}, About(Vec3::UnitZ(), 0.3)};
  const auto points = FindBoxBoxContact(table, {}, kCube, cube, 0.01);
  REQUIRE(points.size() == 4);
  for (const ContactPoint& point : points) {
    CHECK((point.normal_W + Vec3::UnitZ()).norm() < 1e-12);
    CHECK(point.gap == Approx(0.001).margin(1e-12));
    CHECK(point.point_W.z() == Approx(0.05).margin(1e-12));
    const Vec3 local = cube.Inverse() * point.point_W;
    CHECK(std::abs(std::abs(local.x()) - 0.03) < 1e-12);
    CHECK(std::abs(std::abs(local.y()) - 0.03) < 1e-12);
  }
}

TEST_CASE("a cube half over the edge stands on what is above the other") {
  const Pose cube{{0.04, 0, 0.06}};
  const auto points = FindBoxBoxContact(kCube, cube, kCube, {}, 0.001);
  REQUIRE(points.size() == 4);
  double least = 1;
  double most = -1;
  for (const ContactPoint& point : points) {
    CHECK(point.gap == Approx(0).margin(1e-12));
    CHECK(point.point_W.z() == Approx(0.03).margin(1e-12));
    least = std::min(least, point.point_W.x());
    most = std::max(most, point.point_W.x());
  }
  CHECK(least == Approx(0.01).margin(1e-12));
  CHECK(most == Approx(0.03).margin(1e-12));
}

TEST_CASE("a cube turned by 45 degrees on another stands on eight points") {
  const Pose cube{{0, 0, 0.06}, About(Vec3::UnitZ(), kEighth)};
  CHECK(FindBoxBoxContact(kCube, cube, kCube, {}, 0.001).size() == 8);
}

TEST_CASE("a corner over a face is one point as near as it is") {
  // The diagonal upright: the lowest corner is sqrt(3) half edges below the centre.
  const Quat upright = Quat::FromTwoVectors(Vec3(1, 1, 1), Vec3::UnitZ());
  for (const double gap : {0.002, -0.002}) {
    const Pose cube{{0.004, 0.003, 0.03 + 0.03 * std::sqrt(3) + gap}, upright};
    const auto points = FindBoxBoxContact(kCube, cube, kCube, {}, 0.005);
    const double least = LeastGap(points);
    CHECK(least == Approx(gap).margin(1e-12));
    for (const ContactPoint& point : points) CHECK((point.normal_W - Vec3::UnitZ()).norm() < 1e-12);
    const auto reverse = FindBoxBoxContact(kCube, {}, kCube, cube, 0.005);
    CHECK(LeastGap(reverse) == Approx(gap).margin(1e-12));
    for (const ContactPoint& point : reverse)
      CHECK((point.normal_W + Vec3::UnitZ()).norm() < 1e-12);
  }
}

TEST_CASE("two crossed edges meet in one point") {
  for (const double gap : {0.002, -0.002}) {
    const Pose lower{Vec3::Zero(), About(Vec3::UnitX(), kEighth)};  // an edge along x on top
    const double height = 0.03 * std::sqrt(2);
    const Pose upper{{0.005, 0.008, 2 * height + gap}, About(Vec3::UnitY(), kEighth)};
    const auto points = FindBoxBoxContact(kCube, upper, kCube, lower, 0.005);
    REQUIRE(points.size() == 1);
    CHECK(points[0].gap == Approx(gap).margin(1e-12));
    CHECK((points[0].normal_W - Vec3::UnitZ()).norm() < 1e-12);
    CHECK((points[0].point_W - Vec3(0.005, 0, height + gap)).norm() < 1e-12);
  }
}

TEST_CASE("beyond reach, and beside each other, there is nothing") {
  CHECK(FindBoxBoxContact(kCube, {{0, 0, 0.0711}}, kCube, {}, 0.011).empty());
  CHECK_FALSE(FindBoxBoxContact(kCube, {{0, 0, 0.0709}}, kCube, {}, 0.011).empty());
  // Diagonally apart by more than the reach, though along each axis by less.
  CHECK(FindBoxBoxContact(kCube, {{0.07, 0.07, 0.07}}, kCube, {}, 0.011).empty());
}

TEST_CASE(
    "random boxes: points on the first, normals out of the second, gaps no less than the truth") {
  std::mt19937 random(23);
  std::uniform_real_distribution<double> any(-1, 1);
  int overlapping = 0;
  int apart = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    const auto size = [&] { return 0.03 + 0.02 * any(random); };
    const Box first{{size(), size(), size()}};
    const Box second{{size(), size(), size()}};
    const auto turn = [&] {
      return Quat(any(random), any(random), any(random), any(random)).normalized();
    };
    const Pose pose_F{0.1 * Vec3(any(random), any(random), any(random)), turn()};
    const Pose pose_S{0.02 * Vec3(any(random), any(random), any(random)), turn()};
    const auto points = FindBoxBoxContact(first, pose_F, second, pose_S, 0.02);
    const double distance = Distance(first, pose_F, second, pose_S);
    CAPTURE(trial, distance);
    if (distance < 1e-9) {
      ++overlapping;
      REQUIRE_FALSE(points.empty());
      REQUIRE(LeastGap(points) < 1e-9);
    }
    REQUIRE(points.size() <= 8);
    for (const ContactPoint& point : points) {
      REQUIRE(point.gap <= 0.02);
      REQUIRE(std::abs(point.normal_W.norm() - 1) < 1e-12);
      // On the surface of the first box, the plane through the second's surface opposite.
      if (point.gap >= 0) {
        REQUIRE(Outside(first, pose_F, point.point_W) < 1e-9);
        // Two edges may pass beside each other: their gap is that of the planes.
        if (points.size() > 1) REQUIRE(distance <= point.gap + 1e-6);
      }
      const Vec3 opposite = point.point_W - point.gap * point.normal_W;
      REQUIRE(Outside(second, pose_S, opposite + 1e-9 * point.normal_W) > -1e-6);
    }
    if (distance > 1e-6 && !points.empty()) {
      ++apart;
      // Nothing of the second is above the plane, nothing of the first below by more than the gap.
      const ContactPoint& point = points[0];
      double lowest = std::numeric_limits<double>::infinity();
      double highest = -lowest;
      for (int corner = 0; corner < 8; ++corner) {
        const Vec3 sign((corner & 1) != 0 ? 1 : -1, (corner & 2) != 0 ? 1 : -1,
                        (corner & 4) != 0 ? 1 : -1);
        lowest = std::min(lowest,
                          point.normal_W.dot(pose_F * Vec3(sign.cwiseProduct(first.half_extents))));
        highest = std::max(
            highest, point.normal_W.dot(pose_S * Vec3(sign.cwiseProduct(second.half_extents))));
      }
      REQUIRE(LeastGap(points) >= lowest - highest - 1e-9);
    }
  }
  CHECK(overlapping > 200);
  CHECK(apart > 100);
}

}  // namespace rikiseki::world
