// SPDX-License-Identifier: MIT
#include "world_server/features/nearest_mesh.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "world_server/geometry/triangle.h"

namespace rikiseki::world {
namespace {

constexpr double kTie = 1e-12;       // of the size: feet as near as this are equally near
constexpr double kSameFoot = 1e-11;  // of the size
constexpr double kLift = 1e-8;       // of the size, off the surface
constexpr double kSlack = 1e-6;      // of a cosine
const double kParallel = std::cos(5 * std::numbers::pi / 180);

// Where a triangle of a mesh is nearest, and on which part of it.
struct Foot {
  using Part = TriangleFoot::Part;

  Vec3 point = Vec3::Zero();
  Part part = Part::kFace;
  int index = 0;  // of the edge (from corner i to i+1) or the corner
  std::uint32_t face = 0;
};

// `place` in the tree's leaves.
Foot FootOn(const TriangleMesh& mesh, std::uint32_t place, const Vec3& p) {
  const TriangleMesh::LeafFace& face = mesh.leaf_face(place);
  const Vec3& a = face.corners[0];
  const TriangleFoot foot = FootOnTriangle(a, face.corners[1], face.corners[2], p);
  // Along the normal it is exact to rounding however large the face is.
  const Vec3 point =
      foot.part == Foot::Part::kFace ? Vec3(p - face.normal.dot(p - a) * face.normal) : foot.point;
  return {point, foot.part, foot.index, mesh.tree().items()[place]};
}

std::uint32_t CornerOf(const TriangleMesh& mesh, const Foot& foot) {
  return mesh.faces()[foot.face].corners[static_cast<std::size_t>(foot.index)];
}

// The angle-weighted normal of the part; its product with p - foot has the sign of the distance.
Vec3 PartNormal(const TriangleMesh& mesh, const Foot& foot) {
  switch (foot.part) {
    case Foot::Part::kEdge:
      return mesh.EdgeNormal(foot.face, foot.index);
    case Foot::Part::kCorner:
      return mesh.corner_normal(CornerOf(mesh, foot));
    default:
      return mesh.faces()[foot.face].normal;
  }
}

// Beside the border of an open mesh nothing is inside.
bool OnBorder(const TriangleMesh& mesh, const Foot& foot) {
  if (foot.part == Foot::Part::kCorner) return mesh.corner_is_open(CornerOf(mesh, foot));
  return foot.part == Foot::Part::kEdge &&
         mesh.faces()[foot.face].neighbours[static_cast<std::size_t>(foot.index)] ==
             TriangleMesh::kNone;
}

NearestPoint PointAt(const TriangleMesh& mesh, const Foot& foot, const Vec3& p) {
  NearestPoint nearest;
  nearest.point = foot.point;
  nearest.normal = PartNormal(mesh, foot);
  const Vec3 from_foot = p - foot.point;
  if (foot.part == Foot::Part::kFace) {
    const Vec3& corner = mesh.corners()[mesh.faces()[foot.face].corners[0]];
    nearest.distance = nearest.normal.dot(p - corner);
    return nearest;
  }
  const double length = from_foot.stableNorm();
  const double side = nearest.normal.dot(from_foot) < 0 && !OnBorder(mesh, foot) ? -1 : 1;
  nearest.distance = side * length;
  if (length > kTie * mesh.size()) {
    nearest.normal = from_foot / nearest.distance;
  } else {
    nearest.degenerate = true;
  }
  return nearest;
}

// The nearest foot, and whether another one is as near.
class Nearest {
 public:
  Nearest(const TriangleMesh& mesh, const Vec3& p) : mesh_(mesh), p_(p) { Walk(); }

  const Foot& foot() const { return foot_; }
  bool tied() const { return tied_; }

 private:
  // A box to look into, and how far it is.
  struct Waiting {
    float squared_distance;
    std::uint32_t box;
  };

  void Walk() {
    Open(0);
    while (count_ > 0) {
      const Waiting next = waiting_[--count_];
      if (next.squared_distance > limit_) continue;
      const BoxTree::Node& node = mesh_.tree().nodes()[next.box / BoxTree::kWidth];
      const std::uint32_t first = node.first[next.box % BoxTree::kWidth];
      const std::uint32_t items = node.count[next.box % BoxTree::kWidth];
      if (items == 0) Open(first);
      for (std::uint32_t i = 0; i < items; ++i) Look(first + i);
    }
  }

  // The nearest of its boxes is the next.
  void Open(std::uint32_t node) {
    const BoxTree::Four distances = eye_.SquaredDistances(mesh_.tree().nodes()[node]);
    const std::size_t begin = count_;
    for (std::uint32_t lane = 0; lane < BoxTree::kWidth; ++lane) {
      const float distance = distances[static_cast<int>(lane)];
      if (distance > limit_) continue;
      std::size_t place = count_++;
      for (; place > begin && waiting_[place - 1].squared_distance < distance; --place) {
        waiting_[place] = waiting_[place - 1];
      }
      waiting_[place] = {distance, BoxTree::BoxNumber(node, lane)};
    }
  }

  void Look(std::uint32_t place) {
    const TriangleMesh::LeafFace& leaf = mesh_.leaf_face(place);
    const double height = leaf.normal.dot(p_ - leaf.corners[0]);
    if (height * height > reach_) return;
    const Foot foot = FootOn(mesh_, place, p_);
    const std::uint32_t face = foot.face;
    const double squared_distance = (p_ - foot.point).squaredNorm();
    if (squared_distance > reach_) return;
    const double distance = std::sqrt(squared_distance);
    const double tie = kTie * (mesh_.size() + distance);
    const bool same = (foot.point - foot_.point).norm() <= kSameFoot * mesh_.size();
    if (distance < distance_ - tie) {
      tied_ = false;
    } else if (!same) {
      tied_ = true;
    }
    // Of triangles that share the foot the first one, so that the walk's order does not matter.
    const bool better = same ? face < foot_.face : distance < distance_;
    if (!better && distance >= distance_ - tie) return;
    foot_ = foot;
    distance_ = distance;
    reach_ = (distance + 2 * tie) * (distance + 2 * tie);
    limit_ = eye_.Limit(distance + 2 * tie);
  }

  const TriangleMesh& mesh_;
  const Vec3& p_;
  Foot foot_;
  double distance_ = std::numeric_limits<double>::infinity();
  double reach_ = std::numeric_limits<double>::infinity();  // squared
  const BoxTree::Eye eye_{p_};
  float limit_ = eye_.Limit(reach_);  // as reach_, for boxes
  std::array<Waiting, BoxTree::kMostWaiting> waiting_;
  std::size_t count_ = 0;
  bool tied_ = false;
};

// Whether the distance from p grows in every direction along the surface, and p sees its outside.
bool IsMinimum(const TriangleMesh& mesh, const Foot& foot, const Vec3& p) {
  const Vec3 from_foot = p - foot.point;
  if (!OnBorder(mesh, foot) && PartNormal(mesh, foot).dot(from_foot) < 0) return false;
  const double slack = kTie * mesh.size();
  const TriangleMesh::Face& face = mesh.faces()[foot.face];
  if (foot.part == Foot::Part::kEdge) {
    const auto edge = static_cast<std::size_t>(foot.index);
    if (face.neighbours[edge] == TriangleMesh::kNone) return true;
    const Vec3 along =
        mesh.corners()[face.corners[(edge + 1) % 3]] - mesh.corners()[face.corners[edge]];
    const Vec3 into = -mesh.faces()[face.neighbours[edge]].normal.cross(along).normalized();
    return from_foot.dot(into) <= slack;
  }
  if (foot.part == Foot::Part::kCorner) {
    const std::uint32_t corner = CornerOf(mesh, foot);
    for (const std::uint32_t touching : mesh.FacesAt(corner)) {
      for (const std::uint32_t other : mesh.faces()[touching].corners) {
        const Vec3 along = mesh.corners()[other] - foot.point;
        if (other != corner && from_foot.dot(along) > slack * along.norm()) return false;
      }
    }
  }
  return true;
}

// Whether the normals of the surface in a box can point at p: else no minimum is in it. After D. Johnson
// and E. Cohen, "Spatialized normal cone hierarchies", 2001.
bool MayFace(const TriangleMesh& mesh, std::uint32_t box, const Vec3& p) {
  const TriangleMesh::NormalCone& cone = mesh.cone(box);
  if (cone.half_angle >= std::numbers::pi / 2) return true;
  const Bounds bounds = mesh.tree().BoxOf(box);
  const Vec3 towards = p - bounds.Middle();
  const double squared_radius = (bounds.high - bounds.low).squaredNorm() / 4;
  const double squared_tangent = towards.squaredNorm() - squared_radius;
  if (squared_tangent <= 0) return true;
  // Both angles, of the cone and of the ball about the node as p sees it, are below a right one;
  // together they may reach beyond it.
  const double radius = std::sqrt(squared_radius);
  const double tangent = std::sqrt(squared_tangent);
  return cone.axis.dot(towards) >=
         cone.cosine * tangent - cone.sine * radius - kSlack * (tangent + radius);
}

void FindMinima(const TriangleMesh& mesh, const Vec3& p, double radius,
                std::vector<NearestPoint>& minima) {
  const auto may_face = [&](std::uint32_t box) { return MayFace(mesh, box, p); };
  mesh.tree().VisitNear(p, radius, may_face, [&](std::uint32_t place) {
    const Foot foot = FootOn(mesh, place, p);
    if (!IsMinimum(mesh, foot, p)) return;
    const NearestPoint minimum = PointAt(mesh, foot, p);
    if (minimum.distance <= radius) minima.push_back(minimum);
  });
  std::stable_sort(minima.begin(), minima.end(), [](const NearestPoint& a, const NearestPoint& b) {
    return a.distance < b.distance;
  });
}

}  // namespace

NearestPoint FindNearest(const TriangleMesh& mesh, const Vec3& p) {
  const Nearest found(mesh, p);
  NearestPoint nearest = PointAt(mesh, found.foot(), p);
  nearest.degenerate = nearest.degenerate || found.tied();
  return nearest;
}

void FindMeshFeatures(const TriangleMesh& mesh, const Vec3& p, double radius,
                      std::vector<NearestPoint>& found) {
  found.clear();
  const NearestPoint nearest = FindNearest(mesh, p);
  if (!(nearest.distance <= radius)) return;
  if (!mesh.flaws().closed() && nearest.distance < -radius) return;
  // From inside, what is felt is what a finger on the surface would feel: at the inner side of a
  // corner both walls, where the nearest point alone is the corner's edge.
  const bool inside = nearest.distance < 0;
  const Vec3 from = inside ? Vec3(nearest.point + kLift * mesh.size() * nearest.normal) : p;
  std::vector<NearestPoint> minima;
  FindMinima(mesh, from, radius, minima);
  if (!inside || minima.empty()) minima.insert(minima.begin(), nearest);
  for (NearestPoint& minimum : minima) {
    const bool known = std::any_of(found.begin(), found.end(), [&](const NearestPoint& nearer) {
      return nearer.normal.dot(minimum.normal) > kParallel ||
             (nearer.point - minimum.point).norm() <= kSameFoot * mesh.size();
    });
    if (known) continue;
    found.push_back(minimum);
    if (found.size() == kMaxFeatures) break;
  }
  if (!inside) return;
  for (NearestPoint& feature : found) {
    feature.distance = feature.normal.dot(p - feature.point);
    feature.point = p - feature.distance * feature.normal;
    feature.degenerate = nearest.degenerate;
  }
}

}  // namespace rikiseki::world
