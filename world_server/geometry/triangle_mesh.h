// SPDX-License-Identifier: MIT
// A surface of triangles with all that a nearest-point query needs of it, worked out once: which
// triangles meet at which edge and corner, the angle-weighted normals there (Baerentzen & Aanaes
// 2005, which alone give the right sign everywhere), a tree of boxes, and in it cones of normals.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "common/geometry.h"
#include "world_server/geometry/box_tree.h"

namespace rikiseki::world {

/// Three corners each, counter-clockwise seen from outside.
using Triangle = std::array<std::uint32_t, 3>;

/// What is wrong with a mesh as the border of a solid; all 0 where nothing is.
struct MeshFlaws {
  std::size_t open_edges = 0;      // of one triangle only
  std::size_t crowded_edges = 0;   // of more than two
  std::size_t twisted_edges = 0;   // of two triangles that face opposite ways
  std::size_t flat_triangles = 0;  // without an area, left out

  bool closed() const { return open_edges + crowded_edges + twisted_edges == 0; }
};

class TriangleMesh {
 public:
  static constexpr std::uint32_t kNone = 0xffffffff;

  struct Face {
    Triangle corners{};
    Triangle neighbours{kNone, kNone, kNone};  // across the edge from corner i to corner i+1
    Vec3 normal = Vec3::UnitZ();               // unit, outward
  };

  /// A face as the tree's leaves need it, at its place in tree().items().
  struct LeafFace {
    std::array<Vec3, 3> corners;
    Vec3 normal;
  };

  /// The normals at which the surface in a box may be met: of its triangles and their neighbours.
  struct NormalCone {
    Vec3 axis = Vec3::UnitZ();
    double half_angle = 0;        // rad; pi: any
    double cosine = 1, sine = 0;  // of it
  };

  /// Corners at the same place are made one. Throws std::invalid_argument where a corner does not
  /// exist or is not finite, or no triangle has an area.
  TriangleMesh(std::span<const Vec3> corners, std::span<const Triangle> triangles);

  const std::vector<Vec3>& corners() const { return corners_; }
  const std::vector<Face>& faces() const { return faces_; }
  const BoxTree& tree() const { return tree_; }
  const MeshFlaws& flaws() const { return flaws_; }
  const Bounds& bounds() const { return bounds_; }

  /// The length that rounding is relative to: the diagonal of its bounds.
  double size() const { return (bounds().high - bounds().low).norm(); }

  /// Of the smallest ball about the middle of its bounds that holds it.
  double radius() const { return radius_; }

  /// m^3; > 0 where the triangles of a closed mesh look outward.
  double Volume() const;

  const LeafFace& leaf_face(std::size_t place) const { return leaf_faces_[place]; }
  /// Of one of the tree's boxes.
  const NormalCone& cone(std::uint32_t box) const { return cones_[box]; }
  const Vec3& corner_normal(std::uint32_t corner) const { return corner_normals_[corner]; }
  bool corner_is_open(std::uint32_t corner) const { return open_corners_[corner] != 0; }

  /// Unit; of an open edge the one face's.
  Vec3 EdgeNormal(std::uint32_t face, int edge) const;

  /// The triangles that meet at a corner.
  std::span<const std::uint32_t> FacesAt(std::uint32_t corner) const {
    return std::span(faces_at_).subspan(faces_begin_[corner],
                                        faces_begin_[corner + 1] - faces_begin_[corner]);
  }

 private:
  void Weld(std::span<const Vec3> corners, std::span<const Triangle> triangles);
  void DropUnusedCorners();
  void Connect();
  void FindCornerNormals();
  NormalCone ConeOf(std::span<const std::uint32_t> faces) const;
  void FindCones();

  std::vector<Vec3> corners_;
  std::vector<Face> faces_;
  std::vector<Vec3> corner_normals_;
  std::vector<std::uint8_t> open_corners_;
  std::vector<std::uint32_t> faces_begin_, faces_at_;
  Bounds bounds_;
  BoxTree tree_;
  std::vector<LeafFace> leaf_faces_;
  std::vector<NormalCone> cones_;
  MeshFlaws flaws_;
  double radius_ = 0;
};

/// Whether two meshes have the same corners and triangles in the same order; either may be null.
bool SameTriangles(const TriangleMesh* a, const TriangleMesh* b);

}  // namespace rikiseki::world
