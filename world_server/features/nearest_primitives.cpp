// SPDX-License-Identifier: MIT
#include "world_server/features/nearest_primitives.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

namespace rikiseki::world {
namespace {

// A sphere about `centre`; `fallback` is the normal where p is the centre.
NearestPoint OfBall(const Vec3& centre, double radius, const Vec3& fallback, const Vec3& p) {
  const Vec3 from_centre = p - centre;
  const double length = from_centre.stableNorm();
  NearestPoint nearest;
  nearest.degenerate = length == 0;
  nearest.normal = nearest.degenerate ? fallback : Vec3(from_centre / length);
  nearest.point = centre + radius * nearest.normal;
  nearest.distance = length - radius;
  return nearest;
}

}  // namespace

NearestPoint FindNearest(const Sphere& sphere, const Vec3& p) {
  return OfBall(Vec3::Zero(), sphere.radius, Vec3::UnitZ(), p);
}

NearestPoint FindNearest(const Capsule& capsule, const Vec3& p) {
  const double z = std::clamp(p.z(), -capsule.half_length, capsule.half_length);
  return OfBall({0, 0, z}, capsule.radius, Vec3::UnitX(), p);
}

NearestPoint FindNearest(const HalfSpace& half_space, const Vec3& p) {
  const double distance = half_space.normal.dot(p);
  return {
      .point = p - distance * half_space.normal, .normal = half_space.normal, .distance = distance};
}

NearestPoint FindNearest(const Box& box, const Vec3& p) {
  const Vec3& half = box.half_extents;
  const Vec3 inside = p.cwiseMax(-half).cwiseMin(half);
  NearestPoint nearest;
  if (inside != p) {
    nearest.point = inside;
    nearest.distance = (p - inside).stableNorm();
    nearest.normal = (p - inside) / nearest.distance;
    return nearest;
  }
  const Vec3 depth = half - p.cwiseAbs();
  int axis = 0;
  const double least = depth.minCoeff(&axis);
  // As near to two faces, or to two opposite ones: on the medial planes, or on an edge.
  nearest.degenerate = (depth.array() == least).count() > 1 || p[axis] == 0;
  nearest.normal = Vec3::Unit(axis) * (p[axis] < 0 ? -1.0 : 1.0);
  nearest.point = p;
  nearest.point[axis] = std::copysign(half[axis], nearest.normal[axis]);
  nearest.distance = -least;
  return nearest;
}

NearestPoint FindNearest(const Cylinder& cylinder, const Vec3& p) {
  const double axis_distance = std::hypot(p.x(), p.y());
  const Vec3 radial =
      axis_distance > 0 ? Vec3(p.x() / axis_distance, p.y() / axis_distance, 0) : Vec3::UnitX();
  const Vec3 axial = Vec3::UnitZ() * (p.z() < 0 ? -1.0 : 1.0);
  const double beyond_side = axis_distance - cylinder.radius;
  const double beyond_cap = std::abs(p.z()) - cylinder.half_length;
  const Vec3 on_side = Vec3(cylinder.radius * radial.x(), cylinder.radius * radial.y(), p.z());
  const Vec3 on_cap = Vec3(p.x(), p.y(), std::copysign(cylinder.half_length, axial.z()));

  if (beyond_side > 0 && beyond_cap > 0) {  // the rim
    const double distance = std::hypot(beyond_side, beyond_cap);
    return {.point = Vec3(on_side.x(), on_side.y(), on_cap.z()),
            .normal = (beyond_side * radial + beyond_cap * axial) / distance,
            .distance = distance};
  }
  if (beyond_side > beyond_cap) {
    return {.point = on_side,
            .normal = radial,
            .distance = beyond_side,
            .degenerate = axis_distance == 0};
  }
  return {.point = on_cap,
          .normal = axial,
          .distance = beyond_cap,
          .degenerate = beyond_side == beyond_cap || p.z() == 0};
}

namespace {

// Nearest point x of an ellipsoid in `n` dimensions with radii e[0] >= e[1] >= ..., for y >= 0.
// False if it is not the only one. After D. Eberly, "Distance from a point to an ellipse, an
// ellipsoid, or a hyperellipsoid": x_i = e_i^2 y_i / (s + e_i^2) with the largest root s; here in t
// = (s + e_last^2) / e_last^2, which keeps its relative precision near the medial disc.
bool EllipsoidFoot(int n, const Vec3& e, const Vec3& y, Vec3& x) {
  const int last = n - 1;
  if (n == 1) {
    x[0] = e[0];
    return y[0] > 0;
  }
  if (y[last] > 0) {
    Vec3 r = Vec3::Ones();
    Vec3 z = Vec3::Zero();
    double t = 0;
    for (int i = 0; i < n; ++i) {
      r[i] = (e[i] / e[last]) * (e[i] / e[last]);
      z[i] = y[i] / e[i];
      t = std::max(t, r[i] * z[i] - (r[i] - 1));  // where this term alone reaches 1
    }
    // F(t) = sum (r z / (t + r - 1))^2 - 1 falls and is convex, and F >= 0 at the start: Newton's
    // method grows monotonically to the root, and stops where rounding ends the growth.
    for (;;) {
      double value = -1;
      double slope = 0;
      for (int i = 0; i < n; ++i) {
        const double term = r[i] * z[i] / (t + (r[i] - 1));
        value += term * term;
        slope -= 2 * term * term / (t + (r[i] - 1));
      }
      const double next = t - value / slope;
      if (!(next > t)) break;
      t = next;
    }
    for (int i = 0; i < n; ++i) x[i] = r[i] * y[i] / (t + (r[i] - 1));
    return true;
  }

  // In the plane across the shortest axis: two symmetric feet where p lies inside the medial disc.
  double rest = 1;
  bool inside = true;
  for (int i = 0; i < last; ++i) {
    const double denominator = (e[i] - e[last]) * (e[i] + e[last]);
    inside = inside && e[i] * y[i] < denominator;
    if (!inside) break;
    const double ratio = e[i] * y[i] / denominator;
    x[i] = e[i] * ratio;
    rest -= ratio * ratio;
  }
  if (inside && rest > 0) {
    x[last] = e[last] * std::sqrt(rest);
    return false;
  }
  x[last] = 0;
  return EllipsoidFoot(last, e, y, x);
}

}  // namespace

NearestPoint FindNearest(const Ellipsoid& ellipsoid, const Vec3& p) {
  const Vec3& radii = ellipsoid.radii;
  std::array<int, 3> order{};
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return radii[a] > radii[b]; });

  Vec3 e, y, x;
  for (int i = 0; i < 3; ++i) {
    e[i] = radii[order[i]];
    y[i] = std::abs(p[order[i]]);
    if (y[i] < 1e-150 * e[i]) y[i] = 0;  // its square would underflow
  }
  NearestPoint nearest;
  nearest.degenerate = !EllipsoidFoot(3, e, y, x);
  for (int i = 0; i < 3; ++i) nearest.point[order[i]] = p[order[i]] < 0 ? -x[i] : x[i];
  const Vec3 gradient = nearest.point.cwiseQuotient(radii).cwiseQuotient(radii / radii.maxCoeff());
  nearest.normal = gradient.stableNormalized();
  // p - point is along the normal: the product keeps the sign, and precision near the surface.
  nearest.distance = nearest.normal.dot(p - nearest.point);
  return nearest;
}

}  // namespace rikiseki::world
