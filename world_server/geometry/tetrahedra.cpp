// SPDX-License-Identifier: MIT
#include "world_server/geometry/tetrahedra.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

namespace rikiseki::world {
namespace {

constexpr double kCore = 0.5;       // of a ball's radius: half of the inner grid's edge
constexpr double kRoundness = 0.5;  // of the inner grid, from a cube (0) to a ball (1)

double SixVolumes(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
  return (b - a).cross(c - a).dot(d - a);
}

void AddOriented(TetrahedralMesh& mesh, Tetrahedron corners) {
  const auto at = [&](std::size_t i) -> const Vec3& { return mesh.nodes[corners[i]]; };
  if (SixVolumes(at(0), at(1), at(2), at(3)) < 0) std::swap(corners[2], corners[3]);
  mesh.tetrahedra.push_back(corners);
}

double CellsAlong(double length, double edge) {
  return std::max(1.0, std::round(length / edge));
}

// A grid over the cube from -1 to 1, each cell in six tetrahedra round a diagonal.
TetrahedralMesh UnitGrid(const std::array<std::uint32_t, 3>& cells) {
  static constexpr std::array<std::array<int, 3>, 6> kOrders = {
      {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {0, 2, 1}, {2, 1, 0}, {1, 0, 2}}};
  TetrahedralMesh mesh;
  const auto index = [&](const std::array<std::uint32_t, 3>& at) {
    return at[0] + (cells[0] + 1) * (at[1] + (cells[1] + 1) * at[2]);
  };
  for (std::uint32_t z = 0; z <= cells[2]; ++z) {
    for (std::uint32_t y = 0; y <= cells[1]; ++y) {
      for (std::uint32_t x = 0; x <= cells[0]; ++x) {
        mesh.nodes.emplace_back(2.0 * x / cells[0] - 1, 2.0 * y / cells[1] - 1,
                                2.0 * z / cells[2] - 1);
      }
    }
  }
  for (std::uint32_t z = 0; z < cells[2]; ++z) {
    for (std::uint32_t y = 0; y < cells[1]; ++y) {
      for (std::uint32_t x = 0; x < cells[0]; ++x) {
        const std::array<std::uint32_t, 3> cell = {x, y, z};
        for (const auto& order : kOrders) {
          // From one corner of the cell to the opposite one, an axis at a time; mirrored in odd cells.
          std::array<std::uint32_t, 3> at = cell;
          for (std::size_t axis = 0; axis < 3; ++axis) at[axis] += cell[axis] % 2;
          Tetrahedron corners{index(at)};
          for (std::size_t i = 0; i < 3; ++i) {
            const auto axis = static_cast<std::size_t>(order[i]);
            at[axis] = cell[axis] + 1 - cell[axis] % 2;
            corners[i + 1] = index(at);
          }
          AddOriented(mesh, corners);
        }
      }
    }
  }
  return mesh;
}

std::array<std::uint32_t, 3> CellsOf(const Vec3& half_extents, double edge) {
  std::array<std::uint32_t, 3> cells{};
  for (int axis = 0; axis < 3; ++axis) {
    cells[static_cast<std::size_t>(axis)] =
        static_cast<std::uint32_t>(CellsAlong(2 * half_extents[axis], edge));
  }
  return cells;
}

// Of the cube inside a ball, and of the layers round it.
double CoreCells(const Vec3& radii, double edge) {
  return 2 * CellsAlong(kCore * radii.maxCoeff(), edge);
}
double LayersOf(const Vec3& radii, double edge) {
  return CellsAlong((1 - kCore) * radii.maxCoeff(), edge);
}

}  // namespace

double TetrahedralMesh::Volume() const {
  double volume = 0;
  for (const Tetrahedron& t : tetrahedra) {
    volume += SixVolumes(nodes[t[0]], nodes[t[1]], nodes[t[2]], nodes[t[3]]) / 6;
  }
  return volume;
}

TetrahedralMesh MeshBox(const Vec3& half_extents, double edge_m) {
  TetrahedralMesh mesh = UnitGrid(CellsOf(half_extents, edge_m));
  for (Vec3& node : mesh.nodes) node = node.cwiseProduct(half_extents);
  return mesh;
}

TetrahedralMesh MeshEllipsoid(const Vec3& radii, double edge_m) {
  const auto cells = static_cast<std::uint32_t>(CoreCells(radii, edge_m));
  const auto layers = static_cast<std::uint32_t>(LayersOf(radii, edge_m));
  const TetrahedralMesh grid = UnitGrid({cells, cells, cells});
  TetrahedralMesh mesh = grid;
  for (Vec3& node : mesh.nodes) {
    const double length = node.norm();
    if (length == 0) continue;
    const double to_ball = node.cwiseAbs().maxCoeff() / length;
    node *= kCore * (1 - kRoundness + kRoundness * to_ball);
  }
  // Each outer triangle of the core goes outward, layer by layer, as prisms of three tetrahedra; all
  // diagonals start at the lower number, so that neighbours agree.
  std::map<std::uint32_t, std::uint32_t> column;  // of a core node: where its outer nodes begin
  for (const Triangle& triangle : SurfaceOf(grid)) {
    Triangle sorted = triangle;
    std::sort(sorted.begin(), sorted.end());
    for (const std::uint32_t corner : sorted) {
      if (!column.emplace(corner, static_cast<std::uint32_t>(mesh.nodes.size())).second) continue;
      const Vec3 inner = mesh.nodes[corner];
      const Vec3 outer = inner.normalized();
      for (std::uint32_t layer = 1; layer <= layers; ++layer) {
        const double share = static_cast<double>(layer) / layers;
        mesh.nodes.emplace_back(layer == layers ? outer
                                                : Vec3((1 - share) * inner + share * outer));
      }
    }
    for (std::uint32_t layer = 0; layer < layers; ++layer) {
      Triangle below{}, above{};
      for (std::size_t i = 0; i < 3; ++i) {
        const std::uint32_t first = column[sorted[i]];
        below[i] = layer == 0 ? sorted[i] : first + layer - 1;
        above[i] = first + layer;
      }
      AddOriented(mesh, {below[0], below[1], below[2], above[2]});
      AddOriented(mesh, {below[0], below[1], above[1], above[2]});
      AddOriented(mesh, {below[0], above[0], above[1], above[2]});
    }
  }
  for (Vec3& node : mesh.nodes) node = node.cwiseProduct(radii);
  return mesh;
}

double BoxNodeCount(const Vec3& half_extents, double edge_m) {
  double count = 1;
  for (const double half : half_extents) count *= CellsAlong(2 * half, edge_m) + 1;
  return count;
}

double EllipsoidNodeCount(const Vec3& radii, double edge_m) {
  const double cells = CoreCells(radii, edge_m);
  return std::pow(cells + 1, 3) + LayersOf(radii, edge_m) * (6 * cells * cells + 2);
}

std::vector<Triangle> SurfaceOf(const TetrahedralMesh& mesh) {
  // Outward of a tetrahedron with positive volume.
  static constexpr std::array<std::array<std::size_t, 3>, 4> kFaces = {
      {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}}};
  const auto sides = [&](const auto& visit) {
    for (const Tetrahedron& t : mesh.tetrahedra) {
      for (const auto& [i, j, k] : kFaces) {
        const Triangle face = {t[i], t[j], t[k]};
        Triangle sorted = face;
        std::sort(sorted.begin(), sorted.end());
        visit(face, sorted);
      }
    }
  };
  std::map<Triangle, int> count;
  sides([&](const Triangle&, const Triangle& sorted) { ++count[sorted]; });
  std::vector<Triangle> surface;
  sides([&](const Triangle& face, const Triangle& sorted) {
    if (count[sorted] == 1) surface.push_back(face);
  });
  return surface;
}

}  // namespace rikiseki::world
