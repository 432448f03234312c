// SPDX-License-Identifier: MIT
#include "world_server/physics/shape_contact.h"

#include <utility>

#include "world_server/features/nearest_point.h"
#include "world_server/physics/box_box_contact.h"
#include "world_server/physics/box_plane_contact.h"
#include "world_server/physics/convex_contact.h"
#include "world_server/physics/cylinder_contact.h"
#include "world_server/physics/hull_contact.h"
#include "world_server/physics/mesh_contact.h"
#include "world_server/physics/placed_convex.h"

namespace rikiseki::world {
namespace {

using Points = std::vector<ContactPoint>;

// Contacts of the second shape with the first, told from the other side.
Points Swapped(Points points) {
  for (ContactPoint& point : points) {
    point.point_W -= point.gap * point.normal_W;
    point.normal_W = -point.normal_W;
    point.radius = 0;
  }
  return points;
}

Points SphereContact(const Sphere& sphere, const Vec3& centre, const Shape& second,
                     const Pose& pose_WS, double reach_m) {
  std::vector<NearestPoint> nearest;
  FindFeatures(second, pose_WS.Inverse() * centre, sphere.radius + reach_m, nearest);
  Points points;
  for (const NearestPoint& found : nearest) {
    const Vec3 normal = pose_WS.orientation * found.normal;
    points.push_back({.point_W = centre - sphere.radius * normal,
                      .normal_W = normal,
                      .gap = found.distance - sphere.radius,
                      .radius = sphere.radius});
  }
  return points;
}

Points PlaneContact(const Solid& first, const Pose& pose_WF, const Vec3& normal_W, double offset_m,
                    double reach_m) {
  if (const auto* box = std::get_if<Box>(&first.shape)) {
    return FindBoxPlaneContact(*box, pose_WF, normal_W, offset_m, reach_m);
  }
  if (first.faces) {
    return FindHullPlaneContact(*first.faces, pose_WF, normal_W, offset_m, reach_m);
  }
  const PlacedConvex placed(first, pose_WF);
  const double rounding = placed.RoundingAgainst(normal_W);
  Points points;
  for (const Polygon& polygon : placed.Against(normal_W)) {
    for (const Vec3& of_core : polygon) {
      const Vec3 point = of_core - placed.radius() * normal_W;
      const double gap = normal_W.dot(point) - offset_m;
      if (gap <= reach_m) points.push_back({point, normal_W, gap, rounding});
    }
  }
  return points;
}

Points BoxContact(const Solid& first, const Pose& pose_WF, const Box& box, const Pose& pose_WS,
                  double reach_m) {
  if (const auto* other = std::get_if<Box>(&first.shape)) {
    return FindBoxBoxContact(*other, pose_WF, box, pose_WS, reach_m);
  }
  if (const auto* cylinder = std::get_if<Cylinder>(&first.shape)) {
    return FindCylinderBoxContact(*cylinder, pose_WF, box, pose_WS, reach_m);
  }
  return FindHullBoxContact(*first.faces, pose_WF, box, pose_WS, reach_m);
}

// Whether a routine of its own knows the shape on a box.
bool KnowsBoxes(const Solid& first) {
  return std::holds_alternative<Box>(first.shape) ||
         std::holds_alternative<Cylinder>(first.shape) || first.faces != nullptr;
}

bool StandsSecond(const Shape& shape) {
  return std::holds_alternative<HalfSpace>(shape) || std::holds_alternative<Mesh>(shape);
}

}  // namespace

std::vector<ContactPoint> FindShapeContact(const Solid& first, const Pose& pose_WF,
                                           const Solid& second, const Pose& pose_WS,
                                           double reach_m) {
  const auto swapped = [&] {
    return Swapped(FindShapeContact(second, pose_WS, first, pose_WF, reach_m));
  };
  if (StandsSecond(first.shape)) return swapped();
  if (const auto* sphere = std::get_if<Sphere>(&first.shape)) {
    return SphereContact(*sphere, pose_WF.position, second.shape, pose_WS, reach_m);
  }
  if (std::holds_alternative<Sphere>(second.shape)) return swapped();
  if (const auto* half_space = std::get_if<HalfSpace>(&second.shape)) {
    const Vec3 normal = pose_WS.orientation * half_space->normal;
    return PlaneContact(first, pose_WF, normal, normal.dot(pose_WS.position), reach_m);
  }
  if (const auto* mesh = std::get_if<Mesh>(&second.shape)) {
    return FindMeshContact(first, pose_WF, *mesh->mesh, pose_WS, reach_m);
  }
  if (const auto* box = std::get_if<Box>(&second.shape); box != nullptr && KnowsBoxes(first)) {
    return BoxContact(first, pose_WF, *box, pose_WS, reach_m);
  }
  if (std::holds_alternative<Box>(first.shape) && KnowsBoxes(second)) return swapped();
  return FindConvexContact(PlacedConvex(first, pose_WF), PlacedConvex(second, pose_WS), reach_m);
}

}  // namespace rikiseki::world
