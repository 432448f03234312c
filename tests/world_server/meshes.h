// SPDX-License-Identifier: MIT
// Meshes that several tests use.
#pragma once

#include <cmath>
#include <numbers>
#include <vector>

#include "world_server/geometry/triangle_mesh.h"

namespace rikiseki::world::test {

struct RawMesh {
  std::vector<Vec3> corners = {};
  std::vector<Triangle> triangles = {};

  /// Two triangles; counter-clockwise from outside.
  void AddQuad(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
    const auto first = static_cast<std::uint32_t>(corners.size());
    corners.insert(corners.end(), {a, b, c, d});
    triangles.push_back({first, first + 1, first + 2});
    triangles.push_back({first, first + 2, first + 3});
  }
};

inline TriangleMesh Build(const RawMesh& raw) {
  return TriangleMesh(raw.corners, raw.triangles);
}

/// A polygon in x-z, counter-clockwise seen from -y, drawn out along y; its caps as a fan from corner
/// 0, which must see them all.
inline RawMesh Prism(const std::vector<std::array<double, 2>>& outline, double half_y) {
  RawMesh raw;
  const std::size_t n = outline.size();
  const auto at = [&](std::size_t i, double y) { return Vec3(outline[i][0], y, outline[i][1]); };
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t j = (i + 1) % n;
    raw.AddQuad(at(i, -half_y), at(i, half_y), at(j, half_y), at(j, -half_y));
  }
  for (std::size_t i = 1; i + 1 < n; ++i) {
    for (const double side : {-1.0, 1.0}) {
      const auto first = static_cast<std::uint32_t>(raw.corners.size());
      raw.corners.insert(raw.corners.end(),
                         {at(0, side * half_y), at(side < 0 ? i : i + 1, side * half_y),
                          at(side < 0 ? i + 1 : i, side * half_y)});
      raw.triangles.push_back({first, first + 1, first + 2});
    }
  }
  return raw;
}

inline RawMesh BoxMesh(const Vec3& half) {
  return Prism(
      {{-half.x(), -half.z()}, {half.x(), -half.z()}, {half.x(), half.z()}, {-half.x(), half.z()}},
      half.y());
}

/// A floor of 0.4 x 0.4 m with its top at z = 0 and a wall on it with its face at x = 0, as one solid.
inline RawMesh CornerMesh() {
  return Prism({{0, 0}, {-0.1, 0.2}, {-0.1, -0.1}, {0.3, -0.1}, {0.3, 0}}, 0.2);
}

/// A closed surface on a grid of angles: `at(u, v)` has period 1 in both.
template <typename At>
RawMesh Wrapped(int n_u, int n_v, const At& at) {
  RawMesh raw;
  const auto corner = [&](int i, int j) {
    return at(static_cast<double>(i % n_u) / n_u, static_cast<double>(j % n_v) / n_v);
  };
  for (int i = 0; i < n_u; ++i) {
    for (int j = 0; j < n_v; ++j) {
      raw.AddQuad(corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1));
    }
  }
  return raw;
}

inline RawMesh Torus(double ring, double tube, int n_u, int n_v) {
  return Wrapped(n_u, n_v, [=](double u, double v) {
    const double a = 2 * std::numbers::pi * u, b = 2 * std::numbers::pi * v;
    const double r = ring + tube * std::cos(b);
    return Vec3(r * std::cos(a), r * std::sin(a), tube * std::sin(b));
  });
}

}  // namespace rikiseki::world::test
