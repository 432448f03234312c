#include "world_server/physics/box_box_contact.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace rikiseki::world {
namespace {

using Polygon = std::vector<Vec3>;

constexpr double kParallel = 1e-6;  // sine: edges more parallel than this span no plane
// Faces go before edges unless the edges are clearly further apart: a box that rocks by a hair still
// stands on its face.
constexpr double kEdgeMargin = 1e-3;  // of the smallest half extent
constexpr double kFaceMargin = 1e-9;  // m: of two equal faces the second box's is the reference

struct Placed {
  Vec3 centre;
  Mat3 axes;
  Vec3 half;

  Placed(const Box& box, const Pose& pose)
      : centre(pose.position), axes(pose.orientation.toRotationMatrix()), half(box.half_extents) {}

  // Half the extent along a unit direction.
  double Extent(const Vec3& direction) const {
    return half.dot((axes.transpose() * direction).cwiseAbs());
  }
};

double Separation(const Placed& a, const Placed& b, const Vec3& axis) {
  return std::abs(axis.dot(a.centre - b.centre)) - a.Extent(axis) - b.Extent(axis);
}

struct BestFace {
  double separation = -std::numeric_limits<double>::infinity();
  int axis = 0;
};

BestFace FindBestFace(const Placed& box, const Placed& other) {
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

BestEdges FindBestEdges(const Placed& first, const Placed& second) {
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

// What of the polygon lies on the inner side of the plane normal . x <= offset.
Polygon Clip(const Polygon& polygon, const Vec3& normal, double offset) {
  Polygon kept;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Vec3& here = polygon[i];
    const Vec3& next = polygon[(i + 1) % polygon.size()];
    const double d_here = normal.dot(here) - offset;
    const double d_next = normal.dot(next) - offset;
    if (d_here <= 0) kept.push_back(here);
    if ((d_here < 0 && d_next > 0) || (d_here > 0 && d_next < 0)) {
      kept.push_back(here + d_here / (d_here - d_next) * (next - here));
    }
  }
  return kept;
}

// The face that looks most against `normal`.
Polygon FaceAgainst(const Placed& box, const Vec3& normal) {
  const Vec3 local = box.axes.transpose() * normal;
  int axis = 0;
  local.cwiseAbs().maxCoeff(&axis);
  const int u = (axis + 1) % 3;
  const int v = (axis + 2) % 3;
  const double side = local[axis] > 0 ? -1 : 1;
  const Vec3 middle = box.centre + side * box.half[axis] * box.axes.col(axis);
  const Vec3 along_u = box.half[u] * box.axes.col(u);
  const Vec3 along_v = box.half[v] * box.axes.col(v);
  return {middle + along_u + along_v, middle - along_u + along_v, middle - along_u - along_v,
          middle + along_u - along_v};
}

struct FacePoint {
  Vec3 point;  // of the incident box
  double gap = 0;
};

// Points of `incident` over the face of `reference` that looks along `normal`.
std::vector<FacePoint> FaceContact(const Placed& reference, int axis, const Vec3& normal,
                                   const Placed& incident) {
  Polygon polygon = FaceAgainst(incident, normal);
  for (const int side : {(axis + 1) % 3, (axis + 2) % 3}) {
    const Vec3 direction = reference.axes.col(side);
    const double middle = direction.dot(reference.centre);
    polygon = Clip(polygon, direction, middle + reference.half[side]);
    if (polygon.empty()) return {};
    polygon = Clip(polygon, -direction, reference.half[side] - middle);
    if (polygon.empty()) return {};
  }
  const double face = normal.dot(reference.centre) + reference.half[axis];
  std::vector<FacePoint> points;
  for (const Vec3& point : polygon) points.push_back({point, normal.dot(point) - face});
  return points;
}

// The point of the first box's edge that is nearest to the second's.
Vec3 EdgePoint(const Placed& first, const Placed& second, const BestEdges& edges,
               const Vec3& normal) {
  const auto corner = [&](const Placed& box, int along, const Vec3& towards) {
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
  const double ab = a.dot(b);
  const Vec3 between = q - p;
  const double t = (between.dot(a) - ab * between.dot(b)) / (1 - ab * ab);
  const double half = first.half[edges.of_first];
  return p + std::clamp(t, -half, half) * a;
}

}  // namespace

std::vector<BoxBoxPoint> FindBoxBoxContact(const Box& first, const Pose& pose_WF, const Box& second,
                                           const Pose& pose_WS, double reach_m) {
  const Placed a(first, pose_WF);
  const Placed b(second, pose_WS);
  const Vec3 towards_first = a.centre - b.centre;
  const BestFace face_a = FindBestFace(a, b);
  const BestFace face_b = FindBestFace(b, a);
  const BestEdges edges = FindBestEdges(a, b);
  const double face = std::max(face_a.separation, face_b.separation);
  const double smallest = std::min(a.half.minCoeff(), b.half.minCoeff());
  if (std::max(face, edges.separation) > reach_m) return {};

  std::vector<BoxBoxPoint> points;
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
  std::erase_if(points, [&](const BoxBoxPoint& point) { return !(point.gap <= reach_m); });
  return points;
}

}  // namespace rikiseki::world
