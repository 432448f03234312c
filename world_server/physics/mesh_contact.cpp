// SPDX-License-Identifier: MIT
#include "world_server/physics/mesh_contact.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "world_server/physics/convex_contact.h"
#include "world_server/scene/shape_size.h"

namespace rikiseki::world {
namespace {

constexpr double kOnePlane =
    1e-6;                         // sine, and of the shape's size: points so alike are of one place
constexpr double kWithin = 1e-6;  // of a cosine: a direction between two normals
constexpr double kDeepest = 1e-3;  // of the shape: points so near the deepest carry the load
constexpr double kFlatCorner =
    1e-6;  // of the shape: a corner of the support polygon stands out so far

constexpr std::size_t kMostMeshPoints = 24;  // more than a local copy takes

// Leaves the corners of the points' outline across their normal, going round. Wrapped from corner to
// corner; what stands out by less than the tolerance is none.
void KeepOutline(std::vector<ContactPoint>& points, double size) {
  if (points.size() < 2) return;
  const double least = kFlatCorner * size;
  const Vec3 normal = points[0].normal_W;
  const auto across = [&](const Vec3& v) { return Vec3(v - v.dot(normal) * normal); };
  // From the same corner whatever the triangles' order: the solver goes on from the last impulses.
  const Vec3 u = normal.unitOrthogonal();
  const Vec3 v = normal.cross(u);
  std::size_t start = 0;
  for (std::size_t i = 1; i < points.size(); ++i) {
    const Vec3 lead = points[i].point_W - points[start].point_W;
    const double ahead = u.dot(lead);
    if (ahead > least || (ahead >= -least && v.dot(lead) > 0)) start = i;
  }
  std::vector<ContactPoint> kept;
  std::size_t here = start;
  do {
    kept.push_back(points[here]);
    std::size_t next = here;
    Vec3 way = Vec3::Zero();
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Vec3 other = across(points[i].point_W - points[here].point_W);
      if (other.norm() <= least) continue;
      const double right = next == here ? 1 : other.cross(way.normalized()).dot(normal);
      if (right > least || (right >= -least && other.norm() > way.norm())) {
        next = i;
        way = other;
      }
    }
    here = next;
  } while (kept.size() < points.size() &&
           across(points[here].point_W - points[start].point_W).norm() > least);
  points = std::move(kept);
}

class MeshContact {
 public:
  MeshContact(const PlacedConvex& convex, const TriangleMesh& mesh, double size, double reach)
      : convex_(convex),
        mesh_(mesh),
        size_(size),
        reach_(reach),
        margin_(kEdgeMargin * convex.thinnest()) {}

  void Look(std::uint32_t face) {
    const TriangleMesh::Face& triangle = mesh_.faces()[face];
    PlacedTriangle placed{.corners = {}, .normal = triangle.normal};
    for (std::size_t i = 0; i < 3; ++i) placed.corners[i] = mesh_.corners()[triangle.corners[i]];
    const double side = triangle.normal.dot(convex_.centre() - placed.corners[0]);
    if (side < 0) {
      if (mesh_.flaws().closed()) return;
      placed.normal = -placed.normal;
      std::swap(placed.corners[0], placed.corners[1]);
    }
    const PlacedConvex other(placed);
    const double flat = Separation(convex_, other, placed.normal);
    if (flat > reach_) return;
    const ContactAxis over_face{placed.normal, flat, convex_.Support(-placed.normal), {}};
    if (flat >= -margin_ && AddFlat(placed, over_face)) return;
    const ContactAxis axis = FindContactAxis(convex_, other, reach_);
    if (axis.separation > reach_) return;
    if (flat >= axis.separation - margin_) {
      AddFlat(placed, over_face);
    } else if (EndsAlong(face, axis.normal)) {
      for (const ContactPoint& point : PointsAlong(convex_, other, axis, reach_)) Add(point);
    }
  }

  std::vector<ContactPoint> Take() {
    std::vector<ContactPoint> taken;
    for (Place& place : places_) {
      std::vector<ContactPoint>& points = place.points;
      const double deepest = std::ranges::min_element(points, {}, &ContactPoint::gap)->gap;
      std::vector<ContactPoint> loaded;
      for (const ContactPoint& point : points) {
        if (point.gap <= deepest + kDeepest * size_) loaded.push_back(point);
      }
      const bool all = loaded.size() == points.size();
      KeepOutline(loaded, size_);
      KeepSome(loaded);
      taken.insert(taken.end(), loaded.begin(), loaded.end());
      if (all) continue;
      KeepOutline(points, size_);
      KeepSome(points);
      for (const ContactPoint& point : points) {
        if (point.gap > deepest + kDeepest * size_) taken.push_back(point);
      }
    }
    if (taken.size() <= kMostMeshPoints) return taken;
    std::ranges::stable_sort(taken, {}, &ContactPoint::gap);
    taken.resize(kMostMeshPoints);
    return taken;
  }

 private:
  // Points on one flat place of the mesh, or on one flat face of the shape.
  struct Place {
    Vec3 normal;
    double offset;
    std::vector<ContactPoint> points;
  };

  void Add(const ContactPoint& point) {
    const double offset = point.normal_W.dot(point.point_W) - point.gap;
    for (Place& place : places_) {
      if (place.normal.cross(point.normal_W).norm() > kOnePlane ||
          place.normal.dot(point.normal_W) < 0 ||
          std::abs(place.offset - offset) > kOnePlane * size_) {
        continue;
      }
      place.points.push_back(point);
      return;
    }
    places_.push_back({point.normal_W, offset, {point}});
  }

  bool AddFlat(const PlacedTriangle& triangle, const ContactAxis& axis) {
    const Polygon border(triangle.corners.begin(), triangle.corners.end());
    const double offset = axis.normal.dot(border[0]);
    bool over = false;
    for (const Polygon& polygon : convex_.Against(axis.normal)) {
      for (const Vec3& of_core : ClipToBorder(polygon, border, axis.normal)) {
        over = true;
        const Vec3 point = of_core - convex_.radius() * axis.normal;
        const double gap = axis.normal.dot(point) - offset;
        if (gap <= reach_) {
          Add({point, axis.normal, gap, convex_.RoundingAgainst(axis.normal)});
        }
      }
    }
    return over;
  }

  // Whether the surface ends in the triangle's edge or corner that lies furthest along `normal`: all
  // that touches it there falls away.
  bool EndsAlong(std::uint32_t face, const Vec3& normal) const {
    const TriangleMesh::Face& triangle = mesh_.faces()[face];
    std::array<double, 3> heights{};
    for (std::size_t i = 0; i < 3; ++i) heights[i] = normal.dot(Corner(triangle.corners[i]));
    const double highest = *std::ranges::max_element(heights);
    for (std::size_t i = 0; i < 3; ++i) {
      const std::size_t next = (i + 1) % 3;
      if (std::min(heights[i], heights[next]) < highest - kWithin * size_) continue;
      const std::uint32_t beyond = triangle.neighbours[i];
      return beyond == TriangleMesh::kNone || FallsAway(beyond, triangle.corners[i], normal);
    }
    const auto top = std::ranges::max_element(heights) - heights.begin();
    const std::uint32_t corner = triangle.corners[static_cast<std::size_t>(top)];
    return std::ranges::all_of(mesh_.FacesAt(corner), [&](std::uint32_t touching) {
      return FallsAway(touching, corner, normal);
    });
  }

  bool FallsAway(std::uint32_t face, std::uint32_t corner, const Vec3& normal) const {
    return std::ranges::all_of(mesh_.faces()[face].corners, [&](std::uint32_t other) {
      const Vec3 along = Corner(other) - Corner(corner);
      return normal.dot(along) <= kWithin * along.norm();
    });
  }

  const Vec3& Corner(std::uint32_t corner) const { return mesh_.corners()[corner]; }

  const PlacedConvex& convex_;
  const TriangleMesh& mesh_;
  double size_;
  double reach_;
  double margin_;
  std::vector<Place> places_;
};

}  // namespace

std::vector<ContactPoint> FindMeshContact(const Solid& first, const Pose& pose_WF,
                                          const TriangleMesh& mesh, const Pose& pose_WM,
                                          double reach_m) {
  const Pose pose_MF = pose_WM.Inverse() * pose_WF;
  const PlacedConvex convex(first, pose_MF);
  const Ball ball = OuterBall(first.shape);
  MeshContact contact(convex, mesh, 2 * ball.radius, reach_m);
  mesh.tree().VisitNear(
      pose_MF * ball.centre, ball.radius + reach_m, [](std::uint32_t) { return true; },
      [&](std::uint32_t place) { contact.Look(mesh.tree().items()[place]); });
  std::vector<ContactPoint> points = contact.Take();
  PutInWorld(pose_WM, points);
  return points;
}

}  // namespace rikiseki::world
