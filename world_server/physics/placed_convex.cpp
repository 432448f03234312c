// SPDX-License-Identifier: MIT
#include "world_server/physics/placed_convex.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <ranges>
#include <stdexcept>

#include "common/overloaded.h"

namespace rikiseki::world {
namespace {

constexpr double kAlongEdge = 1e-3;      // sine: raised by less, both ends of an edge touch
constexpr std::size_t kManyFaces = 100;  // a hull of more is round enough to be found without

Vec3 SupportOf(const PlacedLine& line, const Vec3& direction) {
  return direction.dot(line.to - line.from) > 0 ? line.to : line.from;
}

Vec3 SupportOf(const PlacedBox& box, const Vec3& direction) {
  return box.Corner(direction);
}

Vec3 SupportOf(const PlacedCylinder& cylinder, const Vec3& direction) {
  const double along = cylinder.axis.dot(direction);
  const Vec3 across = direction - along * cylinder.axis;
  const double length = across.norm();
  const Vec3 out = length > 1e-12 * direction.norm() ? Vec3(across / length) : cylinder.axes.col(0);
  return cylinder.centre + (along > 0 ? 1 : -1) * cylinder.half_length * cylinder.axis +
         cylinder.radius * out;
}

Vec3 SupportOf(const PlacedEllipsoid& ellipsoid, const Vec3& direction) {
  const Vec3 stretched = ellipsoid.radii.cwiseProduct(ellipsoid.axes.transpose() * direction);
  return ellipsoid.centre + ellipsoid.axes * ellipsoid.radii.cwiseProduct(stretched.normalized());
}

std::uint32_t FurthestCorner(const PlacedHull& placed, const Vec3& direction) {
  const Vec3 local = placed.axes.transpose() * direction;
  const std::vector<Vec3>& corners = placed.hull->corners;
  std::uint32_t best = 0;
  double most = -std::numeric_limits<double>::infinity();
  for (std::uint32_t i = 0; i < corners.size(); ++i) {
    const double along = corners[i].dot(local);
    if (along <= most) continue;
    most = along;
    best = i;
  }
  return best;
}

Vec3 CornerOf(const PlacedHull& placed, std::uint32_t corner) {
  return placed.origin + placed.axes * placed.hull->corners[corner];
}

Vec3 SupportOf(const PlacedHull& placed, const Vec3& direction) {
  return CornerOf(placed, FurthestCorner(placed, direction));
}

Vec3 SupportOf(const PlacedTriangle& triangle, const Vec3& direction) {
  return *std::ranges::max_element(triangle.corners, {},
                                   [&](const Vec3& corner) { return corner.dot(direction); });
}

const Polyhedron::Face& FaceOf(const PlacedHull& placed, const Vec3& direction) {
  const Vec3 local = placed.axes.transpose() * direction;
  return *std::ranges::max_element(placed.hull->faces, {},
                                   [&](const Polyhedron::Face& f) { return f.normal.dot(local); });
}

Polygon BorderOf(const PlacedHull& placed, const Polyhedron::Face& face) {
  Polygon border;
  for (const std::uint32_t corner : face.corners) border.push_back(CornerOf(placed, corner));
  return border;
}

std::vector<Polygon> AgainstOf(const PlacedHull& placed, const Vec3& normal) {
  const Polyhedron::Face& face = FaceOf(placed, -normal);
  std::vector<Polygon> found = {BorderOf(placed, face)};
  // Where the hull is needle-sharp the furthest corner may not be of that face.
  const std::uint32_t corner = FurthestCorner(placed, -normal);
  if (std::ranges::find(face.corners, corner) == face.corners.end()) {
    found.push_back({CornerOf(placed, corner)});
  }
  return found;
}

FlatFace MakeFace(const Vec3& normal, Polygon border) {
  const double offset = normal.dot(border.front());
  return {normal, offset, std::move(border)};
}

FlatFace BoxFace(const PlacedBox& box, const Vec3& direction) {
  const Vec3 local = box.axes.transpose() * direction;
  int axis = 0;
  local.cwiseAbs().maxCoeff(&axis);
  const double side = local[axis] > 0 ? 1 : -1;
  Polygon border = box.FaceAgainst(-direction);
  if (side < 0) std::ranges::reverse(border);
  return MakeFace(side * box.axes.col(axis), std::move(border));
}

FlatFace TriangleFace(const PlacedTriangle& triangle, const Vec3& direction) {
  Polygon border(triangle.corners.begin(), triangle.corners.end());
  const bool front = triangle.normal.dot(direction) >= 0;
  if (!front) std::ranges::reverse(border);
  return MakeFace(front ? triangle.normal : Vec3(-triangle.normal), std::move(border));
}

}  // namespace

PlacedConvex::PlacedConvex(const Solid& solid, const Pose& pose)
    : core_(PlacedLine{pose.position, pose.position}), centre_(pose.position) {
  const Mat3 axes = pose.orientation.toRotationMatrix();
  std::visit(Overloaded{[&](const Box& box) {
                          core_ = PlacedBox(box, pose);
                          thinnest_ = box.half_extents.minCoeff();
                        },
                        [&](const Sphere& sphere) { thinnest_ = radius_ = sphere.radius; },
                        [&](const Cylinder& cylinder) {
                          core_ = PlacedCylinder(cylinder, pose);
                          thinnest_ = std::min(cylinder.radius, cylinder.half_length);
                        },
                        [&](const Capsule& capsule) {
                          const Vec3 half = capsule.half_length * axes.col(2);
                          core_ = PlacedLine{pose.position - half, pose.position + half};
                          thinnest_ = radius_ = capsule.radius;
                        },
                        [&](const Ellipsoid& ellipsoid) {
                          core_ = PlacedEllipsoid{pose.position, axes, ellipsoid.radii};
                          thinnest_ = ellipsoid.radii.minCoeff();
                        },
                        [&](const Hull& hull) {
                          core_ = PlacedHull{solid.faces.get(), pose.position, axes};
                          const Bounds& bounds = hull.mesh->bounds();
                          centre_ = pose * Vec3((bounds.low + bounds.high) / 2);
                          thinnest_ = solid.faces->thinnest;
                        },
                        [](const auto&) {
                          throw std::invalid_argument("neither a half-space nor a mesh is convex");
                        }},
             solid.shape);
}

PlacedConvex::PlacedConvex(const PlacedTriangle& triangle)
    : core_(triangle),
      centre_((triangle.corners[0] + triangle.corners[1] + triangle.corners[2]) / 3),
      thinnest_(std::numeric_limits<double>::infinity()) {}

Vec3 PlacedConvex::Support(const Vec3& direction) const {
  return std::visit([&](const auto& core) { return SupportOf(core, direction); }, core_);
}

std::vector<Polygon> PlacedConvex::Against(const Vec3& normal) const {
  using Found = std::vector<Polygon>;
  return std::visit(
      Overloaded{[](const PlacedLine& line) -> Found {
                   if (line.from == line.to) return {{line.from}};
                   return {{line.from, line.to}};
                 },
                 [&](const PlacedBox& box) -> Found { return {box.FaceAgainst(normal)}; },
                 [&](const PlacedCylinder& cylinder) { return cylinder.Against(normal); },
                 [&](const PlacedEllipsoid& ellipsoid) -> Found {
                   return {{SupportOf(ellipsoid, -normal)}};
                 },
                 [&](const PlacedHull& hull) { return AgainstOf(hull, normal); },
                 [](const PlacedTriangle& triangle) -> Found {
                   return {Polygon(triangle.corners.begin(), triangle.corners.end())};
                 }},
      core_);
}

Polygon PlacedConvex::LineAgainst(const Vec3& normal) const {
  Polygon all;
  for (const Polygon& polygon : Against(normal))
    all.insert(all.end(), polygon.begin(), polygon.end());
  const auto lowest =
      std::ranges::min_element(all, {}, [&](const Vec3& p) { return normal.dot(p); });
  Polygon line = {*lowest};
  double longest = 0;
  for (const Vec3& point : all) {
    const double length = (point - *lowest).norm();
    if (length <= longest || normal.dot(point - *lowest) > kAlongEdge * length) continue;
    longest = length;
    line.resize(1);
    line.push_back(point);
  }
  return line;
}

std::optional<FlatFace> PlacedConvex::FaceAlong(const Vec3& direction) const {
  using Found = std::optional<FlatFace>;
  return std::visit(
      Overloaded{[](const PlacedLine&) -> Found { return {}; },
                 [](const PlacedEllipsoid&) -> Found { return {}; },
                 [&](const PlacedBox& box) -> Found { return BoxFace(box, direction); },
                 [&](const PlacedCylinder& cylinder) -> Found {
                   const Vec3 normal = -cylinder.CapSide(direction) * cylinder.axis;
                   return MakeFace(normal, cylinder.RoundCap(direction));
                 },
                 [&](const PlacedHull& placed) -> Found {
                   const Polyhedron::Face& face = FaceOf(placed, direction);
                   return MakeFace(placed.axes * face.normal, BorderOf(placed, face));
                 },
                 [&](const PlacedTriangle& triangle) -> Found {
                   return TriangleFace(triangle, direction);
                 }},
      core_);
}

std::vector<Vec3> PlacedConvex::FaceNormals() const {
  std::vector<Vec3> normals;
  if (const auto* box = std::get_if<PlacedBox>(&core_)) {
    for (int i = 0; i < 3; ++i)
      normals.insert(normals.end(), {box->axes.col(i), -box->axes.col(i)});
  } else if (const auto* cylinder = std::get_if<PlacedCylinder>(&core_)) {
    normals = {cylinder->axis, -cylinder->axis};
  } else if (const auto* triangle = std::get_if<PlacedTriangle>(&core_)) {
    normals = {triangle->normal, -triangle->normal};
  } else if (const auto* placed = std::get_if<PlacedHull>(&core_)) {
    if (placed->hull->faces.size() > kManyFaces) return {};
    for (const Polyhedron::Face& face : placed->hull->faces) {
      normals.emplace_back(placed->axes * face.normal);
    }
  }
  return normals;
}

double PlacedConvex::RoundingAgainst(const Vec3& normal) const {
  const auto* cylinder = std::get_if<PlacedCylinder>(&core_);
  return cylinder != nullptr ? cylinder->RoundingAgainst(normal) : radius_;
}

}  // namespace rikiseki::world
