// SPDX-License-Identifier: MIT
#include "world_server/geometry/triangle_mesh.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <string>
#include <tuple>

namespace rikiseki::world {
namespace {

constexpr std::uint32_t kLeafSize = 2;
constexpr double kFlat = 1e-14;  // of the longest edge: a triangle lower than this has no normal

struct HalfEdge {
  std::uint32_t low, high, face;
  int edge;
  bool upward;  // runs from `low` to `high`

  auto Key() const { return std::tuple(low, high); }
};

bool Before(const Vec3& a, const Vec3& b) {
  return std::tuple(a.x(), a.y(), a.z()) < std::tuple(b.x(), b.y(), b.z());
}

// The angle between two directions, precise where they are nearly equal or opposite.
double Angle(const Vec3& a, const Vec3& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

// The narrowest cone about the middle of the axes that holds all.
TriangleMesh::NormalCone Join(std::span<const TriangleMesh::NormalCone> cones) {
  TriangleMesh::NormalCone joined{.axis = Vec3::Zero()};
  for (const TriangleMesh::NormalCone& cone : cones) joined.axis += cone.axis;
  if (joined.axis.norm() < 1e-9) {
    return {.axis = cones[0].axis, .half_angle = std::numbers::pi};
  }
  joined.axis.normalize();
  for (const TriangleMesh::NormalCone& cone : cones) {
    joined.half_angle =
        std::max(joined.half_angle, Angle(joined.axis, cone.axis) + cone.half_angle);
  }
  joined.half_angle = std::min(joined.half_angle, std::numbers::pi);
  return joined;
}

}  // namespace

TriangleMesh::TriangleMesh(std::span<const Vec3> corners, std::span<const Triangle> triangles) {
  for (const Vec3& corner : corners) {
    if (!corner.allFinite()) throw std::invalid_argument("a corner that is not finite");
  }
  Weld(corners, triangles);
  if (faces_.empty()) throw std::invalid_argument("no triangle with an area");
  Connect();
  FindCornerNormals();
  std::vector<Bounds> boxes(faces_.size());
  for (std::size_t i = 0; i < faces_.size(); ++i) {
    for (const std::uint32_t corner : faces_[i].corners) boxes[i].Add(corners_[corner]);
    bounds_.Add(boxes[i]);
  }
  tree_ = BoxTree(boxes, kLeafSize);
  for (const std::uint32_t item : tree_.items()) {
    LeafFace& leaf = leaf_faces_.emplace_back();
    for (std::size_t i = 0; i < 3; ++i) leaf.corners[i] = corners_[faces_[item].corners[i]];
    leaf.normal = faces_[item].normal;
  }
  for (const Vec3& corner : corners_) {
    radius_ = std::max(radius_, (corner - bounds_.Middle()).norm());
  }
  FindCones();
}

void TriangleMesh::Weld(std::span<const Vec3> corners, std::span<const Triangle> triangles) {
  std::vector<std::uint32_t> order(corners.size());
  for (std::uint32_t i = 0; i < order.size(); ++i) order[i] = i;
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return Before(corners[a], corners[b]) || (!Before(corners[b], corners[a]) && a < b);
  });
  std::vector<std::uint32_t> welded(corners.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    if (i == 0 || corners[order[i]] != corners[order[i - 1]]) corners_.push_back(corners[order[i]]);
    welded[order[i]] = static_cast<std::uint32_t>(corners_.size() - 1);
  }
  for (const Triangle& triangle : triangles) {
    Face face;
    for (std::size_t i = 0; i < 3; ++i) {
      if (triangle[i] >= corners.size()) {
        throw std::invalid_argument("a triangle of corner " + std::to_string(triangle[i]) + " of " +
                                    std::to_string(corners.size()));
      }
      face.corners[i] = welded[triangle[i]];
    }
    const Vec3& a = corners_[face.corners[0]];
    const Vec3 ab = corners_[face.corners[1]] - a;
    const Vec3 ac = corners_[face.corners[2]] - a;
    const double longest = std::max({ab.norm(), ac.norm(), (ac - ab).norm()});
    const Vec3 across = ab.cross(ac);
    if (!(across.norm() > kFlat * longest * longest)) {
      ++flaws_.flat_triangles;
      continue;
    }
    face.normal = across.normalized();
    faces_.push_back(face);
  }
  DropUnusedCorners();
}

void TriangleMesh::DropUnusedCorners() {
  std::vector<std::uint32_t> place(corners_.size(), kNone);
  std::vector<Vec3> used;
  for (Face& face : faces_) {
    for (std::uint32_t& corner : face.corners) {
      if (place[corner] == kNone) {
        place[corner] = static_cast<std::uint32_t>(used.size());
        used.push_back(corners_[corner]);
      }
      corner = place[corner];
    }
  }
  corners_ = std::move(used);
}

void TriangleMesh::Connect() {
  std::vector<HalfEdge> edges;
  edges.reserve(3 * faces_.size());
  for (std::uint32_t face = 0; face < faces_.size(); ++face) {
    for (int edge = 0; edge < 3; ++edge) {
      const std::uint32_t from = faces_[face].corners[static_cast<std::size_t>(edge)];
      const std::uint32_t to = faces_[face].corners[static_cast<std::size_t>((edge + 1) % 3)];
      edges.push_back({std::min(from, to), std::max(from, to), face, edge, from < to});
    }
  }
  std::sort(edges.begin(), edges.end(), [](const HalfEdge& a, const HalfEdge& b) {
    return std::tuple(a.Key(), a.face) < std::tuple(b.Key(), b.face);
  });
  open_corners_.assign(corners_.size(), 0);
  for (std::size_t i = 0, end = 0; i < edges.size(); i = end) {
    while (end < edges.size() && edges[end].Key() == edges[i].Key()) ++end;
    const bool pair = end - i == 2 && edges[i].upward != edges[i + 1].upward;
    if (pair) {
      for (const std::size_t side : {i, i + 1}) {
        const HalfEdge& other = edges[2 * i + 1 - side];
        faces_[edges[side].face].neighbours[static_cast<std::size_t>(edges[side].edge)] =
            other.face;
      }
      continue;
    }
    if (end - i == 1) ++flaws_.open_edges;
    if (end - i == 2) ++flaws_.twisted_edges;
    if (end - i > 2) ++flaws_.crowded_edges;
    open_corners_[edges[i].low] = open_corners_[edges[i].high] = 1;
  }
}

void TriangleMesh::FindCornerNormals() {
  corner_normals_.assign(corners_.size(), Vec3::Zero());
  faces_begin_.assign(corners_.size() + 1, 0);
  for (const Face& face : faces_) {
    for (std::size_t i = 0; i < 3; ++i) {
      const Vec3& at = corners_[face.corners[i]];
      const double angle =
          Angle(corners_[face.corners[(i + 1) % 3]] - at, corners_[face.corners[(i + 2) % 3]] - at);
      corner_normals_[face.corners[i]] += angle * face.normal;
      ++faces_begin_[face.corners[i] + 1];
    }
  }
  for (Vec3& normal : corner_normals_) {
    normal = normal.norm() > 1e-12 ? Vec3(normal.normalized()) : Vec3::UnitZ();
  }
  for (std::size_t i = 0; i < corners_.size(); ++i) faces_begin_[i + 1] += faces_begin_[i];
  faces_at_.resize(3 * faces_.size());
  std::vector<std::uint32_t> next(faces_begin_.begin(), faces_begin_.end() - 1);
  for (std::uint32_t face = 0; face < faces_.size(); ++face) {
    for (const std::uint32_t corner : faces_[face].corners) faces_at_[next[corner]++] = face;
  }
}

// An edge or a corner is met along the normals between those of its faces, so a triangle's cone
// holds those of all that touch it. At an open border the surface is met from any side.
TriangleMesh::NormalCone TriangleMesh::ConeOf(std::span<const std::uint32_t> faces) const {
  NormalCone cone{.axis = Vec3::Zero()};
  for (const std::uint32_t face : faces) cone.axis += faces_[face].normal;
  cone.axis = cone.axis.norm() > 1e-9 ? Vec3(cone.axis.normalized()) : faces_[faces[0]].normal;
  for (const std::uint32_t face : faces) {
    for (const std::uint32_t corner : faces_[face].corners) {
      if (open_corners_[corner] != 0) cone.half_angle = std::numbers::pi;
      for (const std::uint32_t touching : FacesAt(corner)) {
        cone.half_angle = std::max(cone.half_angle, Angle(cone.axis, faces_[touching].normal));
      }
    }
  }
  // Normals between others stay within a cone only up to a half space.
  if (cone.half_angle > std::numbers::pi / 2) cone.half_angle = std::numbers::pi;
  return cone;
}

void TriangleMesh::FindCones() {
  const std::vector<BoxTree::Node>& nodes = tree_.nodes();
  cones_.resize(BoxTree::kWidth * nodes.size());
  for (std::size_t box = cones_.size(); box-- > 0;) {
    const auto number = static_cast<std::uint32_t>(box);
    if (!tree_.Has(number)) continue;
    const BoxTree::Node& node = nodes[box / BoxTree::kWidth];
    const std::uint32_t first = node.first[box % BoxTree::kWidth];
    const std::uint32_t count = node.count[box % BoxTree::kWidth];
    if (count > 0) {
      cones_[box] = ConeOf(std::span(tree_.items()).subspan(first, count));
      continue;
    }
    std::uint32_t within = 0;
    while (within < BoxTree::kWidth && tree_.Has(BoxTree::BoxNumber(first, within))) ++within;
    cones_[box] = Join(std::span(cones_).subspan(BoxTree::BoxNumber(first, 0), within));
  }
  for (NormalCone& cone : cones_) {
    cone.cosine = std::cos(cone.half_angle);
    cone.sine = std::sin(cone.half_angle);
  }
}

Vec3 TriangleMesh::EdgeNormal(std::uint32_t face, int edge) const {
  const Face& here = faces_[face];
  const std::uint32_t neighbour = here.neighbours[static_cast<std::size_t>(edge)];
  if (neighbour == kNone) return here.normal;
  const Vec3 sum = here.normal + faces_[neighbour].normal;
  return sum.norm() > 1e-12 ? Vec3(sum.normalized()) : here.normal;
}

double TriangleMesh::Volume() const {
  double six_volumes = 0;
  const Vec3 origin = bounds().low;
  for (const Face& face : faces_) {
    six_volumes += (corners_[face.corners[0]] - origin)
                       .cross(corners_[face.corners[1]] - origin)
                       .dot(corners_[face.corners[2]] - origin);
  }
  return six_volumes / 6;
}

bool SameTriangles(const TriangleMesh* a, const TriangleMesh* b) {
  if (a == b) return true;
  if (a == nullptr || b == nullptr) return false;
  return a->corners() == b->corners() &&
         std::equal(a->faces().begin(), a->faces().end(), b->faces().begin(), b->faces().end(),
                    [](const TriangleMesh::Face& first, const TriangleMesh::Face& second) {
                      return first.corners == second.corners;
                    });
}

}  // namespace rikiseki::world
