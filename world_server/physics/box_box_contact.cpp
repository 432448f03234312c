// SPDX-License-Identifier: MIT
#include "world_server/physics/box_box_contact.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "world_server/physics/box_faces.h"

namespace rikiseki::world {
namespace {

constexpr double kParallel = 1e-6;    // sine: edges more parallel than this span no plane
constexpr double kFaceMargin = 1e-9;  // m: of two equal faces the second box's is the reference

double Separation(const PlacedBox& a, const PlacedBox& b, const Vec3& axis) {
  return std::abs(axis.dot(a.centre - b.centre)) - a.Extent(axis) - b.Extent(axis);
}

struct BestFace {
  double separation = -std::numeric_limits<double>::infinity();
  int axis = 0;
};

BestFace FindBestFace(const PlacedBox& box, const PlacedBox& other) {
  BestFace best;
  for (int i = 0; i < 3; ++i) {
    const double separation = Separation(box, other, box.axes.col(i));
    if (separation > best.separation) best = {separation, i};
  }
  return best;
}

struct BestEdges {
  double separation = -std::numeric_limits<double>::infinity();
  int of_first = 0, of_second = 0;
  Vec3 axis = Vec3::UnitX();
};

BestEdges FindBestEdges(const PlacedBox& first, const PlacedBox& second) {
  BestEdges best;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      const Vec3 cross = first.axes.col(i).cross(second.axes.col(j));
      const double length = cross.norm();
      if (length < kParallel) continue;
      const Vec3 axis = cross / length;
      const double separation = Separation(first, second, axis);
      if (separation > best.separation) best = {separation, i, j, axis};
    }
  }
  return best;
}

struct FacePoint {
  Vec3 point;  // of the incident box
  double gap = 0;
};

// Points of `incident` over the face of `reference` that looks along `normal`.
std::vector<FacePoint> FaceContact(const PlacedBox& reference, int axis, const Vec3& normal,
                                   const PlacedBox& incident) {
  const Polygon polygon = ClipToFace(incident.FaceAgainst(normal), reference, axis);
  const double face = normal.dot(reference.centre) + reference.half[axis];
  std::vector<FacePoint> points;
  for (const Vec3& point : polygon) points.push_back({point, normal.dot(point) - face});
  return points;
}

// The point of the first box's edge that is nearest to the second's.
Vec3 EdgePoint(const PlacedBox& first, const PlacedBox& second, const BestEdges& edges,
               const Vec3& normal) {
  const auto corner = [&](const PlacedBox& box, int along, const Vec3& towards) {
    Vec3 point = box.centre;
    for (int i = 0; i < 3; ++i) {
      if (i == along) continue;
      const Vec3 axis = box.axes.col(i);
      point += (axis.dot(towards) > 0 ? box.half[i] : -box.half[i]) * axis;
    }
    return point;
  };
  const Vec3 a = first.axes.col(edges.of_first);
  const Vec3 b = second.axes.col(edges.of_second);
  const Vec3 p = corner(first, edges.of_first, -normal);
  const Vec3 q = corner(second, edges.of_second, normal);
  return NearestOnSegment(p, a, first.half[edges.of_first], q, b);
}

}  // namespace

std::vector<ContactPoint> FindBoxBoxContact(const Box& first, const Pose& pose_WF,
                                            const Box& second, const Pose& pose_WS,
                                            double reach_m) {
  const PlacedBox a(first, pose_WF);
  const PlacedBox b(second, pose_WS);
  const Vec3 towards_first = a.centre - b.centre;
  const BestFace face_a = FindBestFace(a, b);
  const BestFace face_b = FindBestFace(b, a);
  const BestEdges edges = FindBestEdges(a, b);
  const double face = std::max(face_a.separation, face_b.separation);
  const double smallest = std::min(a.half.minCoeff(), b.half.minCoeff());
  if (std::max(face, edges.separation) > reach_m) return {};

  std::vector<ContactPoint> points;
  if (edges.separation > face + kEdgeMargin * smallest) {
    const Vec3 normal = edges.axis.dot(towards_first) >= 0 ? edges.axis : Vec3(-edges.axis);
    points.push_back({EdgePoint(a, b, edges, normal), normal, edges.separation});
  } else if (face_b.separation >= face_a.separation - kFaceMargin) {
    const Vec3 axis = b.axes.col(face_b.axis);
    const Vec3 normal = axis.dot(towards_first) >= 0 ? axis : Vec3(-axis);
    for (const FacePoint& found : FaceContact(b, face_b.axis, normal, a)) {
      points.push_back({found.point, normal, found.gap});
    }
  } else {
    const Vec3 axis = a.axes.col(face_a.axis);
    const Vec3 normal = axis.dot(towards_first) >= 0 ? Vec3(-axis) : axis;  // out of the first
    for (const FacePoint& found : FaceContact(a, face_a.axis, normal, b)) {
      points.push_back({found.point - found.gap * normal, -normal, found.gap});
    }
  }
  std::erase_if(points, [&](const ContactPoint& point) { return !(point.gap <= reach_m); });
  return points;
}

}  // namespace rikiseki::world
