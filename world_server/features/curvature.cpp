// SPDX-License-Identifier: MIT
#include "world_server/features/curvature.h"

#include <algorithm>
#include <cmath>

namespace rikiseki::world {
namespace {

constexpr double kFlat = 1e-2;  // of the strongest bend: along less the surface is as good as flat

// The bend of a surface that is round about an axis and straight along it.
Mat3 AboutZ(double radius, const Vec3& normal) {
  const Vec3 across = Vec3::UnitZ().cross(normal);
  return across * across.transpose() / radius;
}

Mat3 OfBall(double radius) {
  return Mat3::Identity() / radius;
}

// Per way along the surface, how far it bends from its tangent plane, twice [1/m]. 0 = flat.
Mat3 Bend(const Sphere& sphere, const NearestPoint&) {
  return OfBall(sphere.radius);
}
Mat3 Bend(const Capsule& capsule, const NearestPoint& nearest) {
  const bool on_cap = std::abs(nearest.point.z()) > capsule.half_length;
  return on_cap ? OfBall(capsule.radius) : AboutZ(capsule.radius, nearest.normal);
}
Mat3 Bend(const Cylinder& cylinder, const NearestPoint& nearest) {
  const bool on_side = nearest.normal.z() == 0;
  return on_side ? AboutZ(cylinder.radius, nearest.normal) : Mat3(Mat3::Zero());
}
Mat3 Bend(const Ellipsoid& ellipsoid, const NearestPoint& nearest) {
  const Vec3 inverse_squares = ellipsoid.radii.cwiseAbs2().cwiseInverse();
  const Vec3 gradient = inverse_squares.cwiseProduct(nearest.point);
  return Mat3(inverse_squares.asDiagonal()) / gradient.norm();
}
template <typename Flat>
Mat3 Bend(const Flat&, const NearestPoint&) {
  return Mat3::Zero();
}

}  // namespace

double RadiusAlong(const Shape& shape, const NearestPoint& nearest, const Vec3& way) {
  const Mat3 bend = std::visit([&](const auto& given) { return Bend(given, nearest); }, shape);
  if (bend.isZero(0)) return 0;
  const Vec3 u = nearest.normal.unitOrthogonal();
  const Vec3 v = nearest.normal.cross(u);
  const double uu = u.dot(bend * u), vv = v.dot(bend * v), uv = u.dot(bend * v);
  const double strongest = (uu + vv) / 2 + std::hypot((uu - vv) / 2, uv);
  const double a = u.dot(way), b = v.dot(way);
  const double squared = a * a + b * b;
  const double along =
      squared > 0 ? (a * a * uu + 2 * a * b * uv + b * b * vv) / squared : strongest;
  return along > kFlat * strongest ? 1 / along : 0;
}

}  // namespace rikiseki::world
