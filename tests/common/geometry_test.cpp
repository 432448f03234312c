// SPDX-License-Identifier: MIT
#include "common/geometry.h"

#include <catch2/catch.hpp>
#include <cmath>

namespace rikiseki {
namespace {

Pose QuarterTurn() {
  return {Vec3(1, 2, 3), Quat(Eigen::AngleAxisd(std::acos(-1.0) / 2, Vec3::UnitZ()))};
}

}  // namespace

TEST_CASE("a pose turns first and shifts then") {
  CHECK((QuarterTurn() * Vec3(1, 0, 0)).isApprox(Vec3(1, 3, 3), 1e-15));
}

TEST_CASE("poses compose like their maps, and an inverse undoes") {
  const Pose a = QuarterTurn();
  const Pose b{Vec3(-0.5, 0.25, 2), Quat(Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized()))};
  const Vec3 p(0.3, -0.7, 1.1);
  CHECK(((a * b) * p).isApprox(a * (b * p), 1e-14));
  CHECK((a.Inverse() * (a * p)).isApprox(p, 1e-14));
  CHECK((a * a.Inverse()).position.norm() < 1e-14);
  CHECK(std::abs((a * b).orientation.norm() - 1) < 1e-15);
}

TEST_CASE("arrays hold a quaternion as w x y z, and go both ways") {
  const Quat q(0.5, -0.5, 0.5, 0.5);
  CHECK(ToArray(q) == std::array<double, 4>{0.5, -0.5, 0.5, 0.5});
  CHECK(ToQuat(ToArray(q)).coeffs() == q.coeffs());
  const Vec3 v(1, 2, 3);
  CHECK(ToVec3(ToArray(v)) == v);
}

}  // namespace rikiseki
