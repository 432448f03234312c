// SPDX-License-Identifier: MIT
#include "world_server/geometry/polyhedron.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

namespace rikiseki::world {
namespace {

constexpr double kFlat = 1e-6;  // of the size
constexpr std::uint32_t kNone = TriangleMesh::kNone;

double Area(const TriangleMesh& mesh, const TriangleMesh::Face& face) {
  const auto corner = [&](std::size_t i) { return mesh.corners()[face.corners[i]]; };
  return (corner(1) - corner(0)).cross(corner(2) - corner(0)).norm() / 2;
}

// Which polygon each triangle belongs to. The largest triangles first: their planes are the surest.
std::vector<std::uint32_t> Group(const TriangleMesh& mesh, std::vector<Polyhedron::Face>& faces) {
  const std::vector<TriangleMesh::Face>& triangles = mesh.faces();
  std::vector<std::uint32_t> order(triangles.size());
  std::iota(order.begin(), order.end(), 0U);
  std::stable_sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return Area(mesh, triangles[a]) > Area(mesh, triangles[b]);
  });
  std::vector<std::uint32_t> group(triangles.size(), kNone);
  for (const std::uint32_t seed : order) {
    if (group[seed] != kNone) continue;
    const auto index = static_cast<std::uint32_t>(faces.size());
    Polyhedron::Face& face = faces.emplace_back();
    face.normal = triangles[seed].normal;
    face.offset = face.normal.dot(mesh.corners()[triangles[seed].corners[0]]);
    const auto lies_in = [&](const TriangleMesh::Face& triangle) {
      return std::ranges::all_of(triangle.corners, [&](std::uint32_t corner) {
        return std::abs(face.normal.dot(mesh.corners()[corner]) - face.offset) <=
               kFlat * mesh.size();
      });
    };
    std::vector<std::uint32_t> queue = {seed};
    group[seed] = index;
    while (!queue.empty()) {
      const TriangleMesh::Face& triangle = triangles[queue.back()];
      queue.pop_back();
      for (const std::uint32_t next : triangle.neighbours) {
        if (next == kNone || group[next] != kNone || !lies_in(triangles[next])) continue;
        group[next] = index;
        queue.push_back(next);
      }
    }
  }
  return group;
}

}  // namespace

Polyhedron::Polyhedron(const TriangleMesh& hull)
    : corners(hull.corners()), thinnest((hull.bounds().high - hull.bounds().low).minCoeff() / 2) {
  const std::vector<std::uint32_t> group = Group(hull, faces);
  // The border of each polygon, from corner to corner.
  std::vector<std::map<std::uint32_t, std::uint32_t>> next(faces.size());
  for (std::uint32_t i = 0; i < group.size(); ++i) {
    const TriangleMesh::Face& triangle = hull.faces()[i];
    for (std::size_t side = 0; side < 3; ++side) {
      const std::uint32_t beyond = triangle.neighbours[side];
      if (beyond != kNone && group[beyond] == group[i]) continue;
      const std::uint32_t from = triangle.corners[side];
      const std::uint32_t to = triangle.corners[(side + 1) % 3];
      next[group[i]][from] = to;
      if (beyond == kNone || i < beyond) {
        edges.push_back({from, to, group[i], beyond == kNone ? group[i] : group[beyond]});
      }
    }
  }
  for (std::size_t i = 0; i < faces.size(); ++i) {
    if (next[i].empty()) continue;
    const std::uint32_t first = next[i].begin()->first;
    std::uint32_t corner = first;
    do {
      faces[i].corners.push_back(corner);
      corner = next[i].at(corner);
    } while (corner != first && faces[i].corners.size() < next[i].size());
  }
}

}  // namespace rikiseki::world
