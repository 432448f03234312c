// SPDX-License-Identifier: MIT
#include "world_server/physics/box_faces.h"

#include <algorithm>

namespace rikiseki::world {

PlacedBox::PlacedBox(const Box& box, const Pose& pose)
    : centre(pose.position), axes(pose.orientation.toRotationMatrix()), half(box.half_extents) {}

double PlacedBox::Extent(const Vec3& direction) const {
  return half.dot((axes.transpose() * direction).cwiseAbs());
}

Vec3 PlacedBox::Corner(const Vec3& direction) const {
  Vec3 corner = centre;
  for (int i = 0; i < 3; ++i) {
    const Vec3 axis = axes.col(i);
    corner += (axis.dot(direction) > 0 ? half[i] : -half[i]) * axis;
  }
  return corner;
}

Polygon PlacedBox::FaceAgainst(const Vec3& normal) const {
  const Vec3 local = axes.transpose() * normal;
  int axis = 0;
  local.cwiseAbs().maxCoeff(&axis);
  const int u = (axis + 1) % 3;
  const int v = (axis + 2) % 3;
  const double side = local[axis] > 0 ? -1 : 1;
  const Vec3 middle = centre + side * half[axis] * axes.col(axis);
  const Vec3 along_u = half[u] * axes.col(u);
  const Vec3 along_v = half[v] * axes.col(v);
  return {middle + along_u + along_v, middle - along_u + along_v, middle - along_u - along_v,
          middle + along_u - along_v};
}

Polygon Clip(const Polygon& polygon, const Vec3& normal, double offset) {
  Polygon kept;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Vec3& here = polygon[i];
    const Vec3& next = polygon[(i + 1) % polygon.size()];
    const double d_here = normal.dot(here) - offset;
    const double d_next = normal.dot(next) - offset;
    if (d_here <= 0) kept.push_back(here);
    if (polygon.size() == 2 && i == 1) continue;  // a segment does not close
    if ((d_here < 0 && d_next > 0) || (d_here > 0 && d_next < 0)) {
      kept.push_back(here + d_here / (d_here - d_next) * (next - here));
    }
  }
  return kept;
}

Polygon ClipToFace(Polygon polygon, const PlacedBox& box, int axis) {
  for (const int side : {(axis + 1) % 3, (axis + 2) % 3}) {
    const Vec3 direction = box.axes.col(side);
    const double middle = direction.dot(box.centre);
    polygon = Clip(polygon, direction, middle + box.half[side]);
    polygon = Clip(polygon, -direction, box.half[side] - middle);
  }
  return polygon;
}

Polygon ClipToBorder(Polygon polygon, const Polygon& border, const Vec3& normal) {
  for (std::size_t i = 0; i < border.size(); ++i) {
    const Vec3 out = (border[(i + 1) % border.size()] - border[i]).cross(normal);
    polygon = Clip(polygon, out, out.dot(border[i]));
  }
  return polygon;
}

Vec3 NearestOnSegment(const Vec3& p, const Vec3& along, double half, const Vec3& q,
                      const Vec3& other) {
  const double cosine = along.dot(other);
  const Vec3 between = q - p;
  const double t = (between.dot(along) - cosine * between.dot(other)) / (1 - cosine * cosine);
  return p + std::clamp(t, -half, half) * along;
}

}  // namespace rikiseki::world
