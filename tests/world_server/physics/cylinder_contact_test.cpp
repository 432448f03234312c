// SPDX-License-Identifier: MIT
#include "world_server/physics/cylinder_contact.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "tests/world_server/physics/contact_trials.h"
#include "world_server/physics/shape_contact.h"

namespace rikiseki::world {
namespace {

using test::LeastGap;

constexpr double kRadius = 0.03;
constexpr double kHalf = 0.02;
const Cylinder kCylinder{kRadius, kHalf};
const Box kTable{{0.2, 0.2, 0.05}};  // its top at z = 0.05

Quat About(const Vec3& axis, double angle) {
  return Quat(Eigen::AngleAxisd(angle, axis.normalized()));
}

// The same contact with a half-space and with the top of a table.
std::vector<std::vector<ContactPoint>> OnBoth(const Pose& pose, double reach) {
  const Pose floor{{0, 0, 0.05}};
  return {FindShapeContact(Solid(kCylinder), pose, Solid(HalfSpace{Vec3::UnitZ()}), floor, reach),
          FindCylinderBoxContact(kCylinder, pose, kTable, {}, reach)};
}

Vec3 Support(const Pose& pose, const Vec3& direction) {
  const Vec3 local = pose.orientation.conjugate() * direction;
  const Vec3 across(local.x(), local.y(), 0);
  return pose * (kRadius * across.normalized() + Vec3(0, 0, local.z() > 0 ? kHalf : -kHalf));
}

}  // namespace

TEST_CASE("an upright cylinder stands on eight points of its rim that go with it") {
  for (const double gap : {0.004, 0.0, -0.002}) {
    const Pose pose{{0.02, -0.01, 0.05 + kHalf + gap}, About(Vec3::UnitZ(), 0.3)};
    for (const auto& points : OnBoth(pose, 0.01)) {
      REQUIRE(points.size() == 8);
      for (std::size_t i = 0; i < 8; ++i) {
        const double angle = static_cast<double>(i) * M_PI / 4;
        const Vec3 expected(kRadius * std::cos(angle), kRadius * std::sin(angle), -kHalf);
        CHECK((pose.Inverse() * points[i].point_W - expected).norm() < 1e-12);
        CHECK((points[i].normal_W - Vec3::UnitZ()).norm() < 1e-12);
        CHECK(points[i].gap == Approx(gap).margin(1e-12));
      }
    }
  }
}

TEST_CASE("a lying cylinder lies on the two ends of its lowest line, wherever it has rolled") {
  for (const double rolled : {0.0, 0.4, 2.5}) {
    const Quat lying = About(Vec3::UnitX(), M_PI / 2);
    const Pose pose{{0.02, -0.01, 0.05 + kRadius - 1e-5}, lying * About(Vec3::UnitZ(), rolled)};
    for (const auto& points : OnBoth(pose, 0.01)) {
      REQUIRE(points.size() == 2);
      for (const ContactPoint& point : points) {
        CHECK(point.gap == Approx(-1e-5).margin(1e-12));
        CHECK(point.point_W.x() == Approx(0.02).margin(1e-12));
        CHECK(std::abs(point.point_W.y() + 0.01) == Approx(kHalf).margin(1e-12));
      }
    }
  }
}

TEST_CASE("a tilted cylinder is as near as the lowest point of its rim") {
  for (const double tilt : {1e-4, 2e-3, 0.1, 0.3, 1.0, 1.5}) {
    for (const double turn : {0.0, 0.2, 0.39}) {
      const double extent = kHalf * std::cos(tilt) + kRadius * std::sin(tilt);
      const Pose pose{{0, 0, 0.05 + extent + 1e-3},
                      About(Vec3::UnitX(), tilt) * About(Vec3::UnitZ(), turn)};
      CAPTURE(tilt, turn);
      // Where the eight points stand for the rim they are higher by r (1 - cos 22.5 deg) sin(tilt).
      for (const auto& points : OnBoth(pose, 0.01)) {
        CHECK(LeastGap(points) ==
              Approx(1e-3).margin(tilt < 1e-3 ? 0.077 * kRadius * tilt : 1e-12));
      }
    }
  }
}

TEST_CASE("over an edge the cylinder stands on what is above the table") {
  const Pose pose{{0.21, 0, 0.05 + kHalf}};
  double most = -1;
  for (const ContactPoint& point : FindCylinderBoxContact(kCylinder, pose, kTable, {}, 0.001)) {
    CHECK(point.gap == Approx(0).margin(1e-12));
    most = std::max(most, point.point_W.x());
  }
  CHECK(most == Approx(0.2).margin(1e-12));
  // The edge of the table is under the rim between two of the eight points.
  const Pose turned{{0.2 + 0.99 * kRadius, 0, 0.05 + kHalf}, About(Vec3::UnitZ(), M_PI / 8)};
  const auto points = FindCylinderBoxContact(kCylinder, turned, kTable, {}, 0.001);
  REQUIRE(points.size() == 1);
  CHECK((points[0].point_W - Vec3(0.2, 0, 0.05)).norm() < 1e-12);
}

TEST_CASE("a small box on a wide cap has its own four corners") {
  const Box die{Vec3::Constant(0.005)};
  const Pose below{{0, 0, -kHalf - 0.005 - 1e-4}, About(Vec3::UnitZ(), 0.2)};
  const auto points = FindCylinderBoxContact(kCylinder, {}, die, below, 0.01);
  REQUIRE(points.size() == 4);
  for (const ContactPoint& point : points) {
    CHECK(point.gap == Approx(1e-4).margin(1e-12));
    CHECK(point.point_W.z() == Approx(-kHalf).margin(1e-12));
    CHECK((point.normal_W - Vec3::UnitZ()).norm() < 1e-12);
    CHECK(point.point_W.head<2>().norm() == Approx(0.005 * std::sqrt(2)));
  }
}

TEST_CASE("the side meets edges: along one in a line, across one in a point") {
  // The edge x = 0.2, z = 0.05 of the table, seen from 45 degrees above.
  const Vec3 out = Vec3(1, 0, 1).normalized();
  const Quat along_y = About(Vec3::UnitX(), M_PI / 2);
  for (const double gap : {1e-3, -1e-3}) {
    const Vec3 centre = Vec3(0.2, 0.03, 0.05) + (kRadius + gap) * out;
    const auto line = FindCylinderBoxContact(kCylinder, {centre, along_y}, kTable, {}, 0.01);
    REQUIRE(line.size() == 2);
    for (const ContactPoint& point : line) {
      CHECK((point.normal_W - out).norm() < 1e-9);
      CHECK(point.gap == Approx(gap).margin(1e-9));
      CHECK(std::abs(point.point_W.y() - 0.03) == Approx(kHalf).margin(1e-9));
    }
    const Quat across = Quat::FromTwoVectors(Vec3::UnitZ(), Vec3(1, 1, -1).normalized());
    const auto points = FindCylinderBoxContact(kCylinder, {centre, across}, kTable, {}, 0.01);
    REQUIRE(points.size() == 1);
    CHECK((points[0].normal_W - out).norm() < 1e-9);
    CHECK(points[0].gap == Approx(gap).margin(1e-9));
    CHECK((points[0].point_W - (centre - kRadius * out)).norm() < 1e-9);
  }
}

TEST_CASE("random cylinders and boxes") {
  test::CheckRandomContacts(
      kHalf,
      [](const Pose& pose, const Box& box, const Pose& pose_B, double reach) {
        return FindCylinderBoxContact(kCylinder, pose, box, pose_B, reach);
      },
      Support);
}

}  // namespace rikiseki::world
