// SPDX-License-Identifier: MIT
#include "world_server/physics/hull_contact.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "world_server/physics/box_faces.h"

namespace rikiseki::world {
namespace {

constexpr double kParallel = 1e-6;  // sine: edges more parallel than this span no plane
constexpr double kLowest = -std::numeric_limits<double>::infinity();

// The face that looks most against a direction, and the corner that lies furthest against it.
// Where the hull is needle-sharp that corner may not be of that face.
struct Against {
  const Polyhedron::Face* face = nullptr;
  std::uint32_t corner = 0;

  Against(const Polyhedron& hull, const Vec3& normal_H) {
    face = &*std::ranges::min_element(
        hull.faces, {}, [&](const Polyhedron::Face& f) { return f.normal.dot(normal_H); });
    const auto lowest =
        std::ranges::min_element(hull.corners, {}, [&](const Vec3& c) { return c.dot(normal_H); });
    corner = static_cast<std::uint32_t>(lowest - hull.corners.begin());
  }

  bool CornerIsOfFace() const {
    return std::ranges::find(face->corners, corner) != face->corners.end();
  }
};

Polygon CornersOf(const Polyhedron& hull, const Polyhedron::Face& face) {
  Polygon polygon;
  for (const std::uint32_t corner : face.corners) polygon.push_back(hull.corners[corner]);
  return polygon;
}

// All in the hull's frame; separations along directions out of the box, towards the hull.
class Pair {
 public:
  Pair(const Polyhedron& hull, const PlacedBox& box) : hull_(hull), box_(box) {}

  std::vector<ContactPoint> Find(double reach) {
    FindBoxFace();
    if (box_face_ > reach) return {};
    FindHullFace();
    if (hull_face_ > reach) return {};
    FindEdges();
    if (edges_ > reach) return {};
    const double margin = kEdgeMargin * std::min(box_.half.minCoeff(), hull_.thinnest);
    if (edges_ > std::max(box_face_, hull_face_) + margin) {
      AddEdges();
    } else if (box_face_ >= hull_face_ - margin) {
      AddOverBox();
    } else {
      AddOverHull();
    }
    // Beside a face, though no edges are clearly the better axis.
    if (points_.empty() && edge_ != nullptr) AddEdges();
    std::erase_if(points_, [&](const ContactPoint& point) { return !(point.gap <= reach); });
    KeepSome(points_);
    return points_;
  }

 private:
  void FindBoxFace() {
    for (int axis = 0; axis < 3; ++axis) {
      double least = std::numeric_limits<double>::infinity();
      double most = kLowest;
      for (const Vec3& corner : hull_.corners) {
        const double along = box_.axes.col(axis).dot(corner - box_.centre);
        least = std::min(least, along);
        most = std::max(most, along);
      }
      for (const double side : {-1.0, 1.0}) {
        const double separation = (side > 0 ? least : -most) - box_.half[axis];
        if (separation <= box_face_) continue;
        box_face_ = separation;
        box_axis_ = axis;
        box_normal_ = side * box_.axes.col(axis);
      }
    }
  }

  void FindHullFace() {
    for (const Polyhedron::Face& face : hull_.faces) {
      const double separation =
          face.normal.dot(box_.centre) - box_.Extent(face.normal) - face.offset;
      if (separation <= hull_face_) continue;
      hull_face_ = separation;
      face_ = &face;
    }
  }

  // A direction across two edges counts where it lies between the normals of the hull's two faces:
  // there the hull ends in that edge.
  void FindEdges() {
    for (const Polyhedron::Edge& edge : hull_.edges) {
      const Vec3& from = hull_.corners[edge.from];
      const Vec3& left = hull_.faces[edge.left].normal;
      const Vec3& right = hull_.faces[edge.right].normal;
      const double between = left.dot(right);
      const Vec3 along = (hull_.corners[edge.to] - from).normalized();
      for (int axis = 0; axis < 3; ++axis) {
        const Vec3 cross = along.cross(box_.axes.col(axis));
        const double sine = cross.norm();
        if (sine < kParallel) continue;
        Vec3 out = cross / sine;
        if (out.dot(left + right) < 0) out = -out;
        if (std::min(out.dot(left), out.dot(right)) < between) continue;
        const double separation = out.dot(box_.centre - from) - box_.Extent(out);
        if (separation <= edges_) continue;
        edges_ = separation;
        edge_ = &edge;
        edge_axis_ = axis;
        edge_normal_ = -out;
      }
    }
  }

  void AddEdges() {
    const Vec3& from = hull_.corners[edge_->from];
    const Vec3& to = hull_.corners[edge_->to];
    const double length = (to - from).norm();
    const Vec3 point = NearestOnSegment((from + to) / 2, (to - from) / length, length / 2,
                                        box_.Corner(edge_normal_), box_.axes.col(edge_axis_));
    points_.push_back({point, edge_normal_, edges_});
  }

  void AddOverBox() {
    const Against against(hull_, box_normal_);
    Polygon polygon = ClipToFace(CornersOf(hull_, *against.face), box_, box_axis_);
    if (!against.CornerIsOfFace()) {
      for (const Vec3& corner : ClipToFace({hull_.corners[against.corner]}, box_, box_axis_)) {
        polygon.push_back(corner);
      }
    }
    const double face = box_normal_.dot(box_.centre) + box_.half[box_axis_];
    for (const Vec3& point : polygon) {
      points_.push_back({point, box_normal_, box_normal_.dot(point) - face});
    }
  }

  void AddOverHull() {
    const Vec3 normal = -face_->normal;
    const Polygon polygon =
        ClipToBorder(box_.FaceAgainst(face_->normal), CornersOf(hull_, *face_), face_->normal);
    for (const Vec3& point : polygon) {
      const double gap = face_->normal.dot(point) - face_->offset;
      points_.push_back({point + gap * normal, normal, gap});
    }
  }

  const Polyhedron& hull_;
  const PlacedBox& box_;
  double box_face_ = kLowest, hull_face_ = kLowest, edges_ = kLowest;
  int box_axis_ = 0, edge_axis_ = 0;
  Vec3 box_normal_ = Vec3::UnitZ(), edge_normal_ = Vec3::UnitZ();
  const Polyhedron::Face* face_ = nullptr;
  const Polyhedron::Edge* edge_ = nullptr;
  std::vector<ContactPoint> points_;
};

}  // namespace

std::vector<ContactPoint> FindHullPlaneContact(const Polyhedron& hull, const Pose& pose_WH,
                                               const Vec3& normal_W, double offset_m,
                                               double reach_m) {
  const Against against(hull, pose_WH.orientation.conjugate() * normal_W);
  std::vector<std::uint32_t> corners = against.face->corners;
  if (!against.CornerIsOfFace()) corners.push_back(against.corner);
  std::vector<ContactPoint> points;
  for (const std::uint32_t corner : corners) {
    const Vec3 point = pose_WH * hull.corners[corner];
    const double gap = normal_W.dot(point) - offset_m;
    if (gap <= reach_m) points.push_back({point, normal_W, gap});
  }
  KeepSome(points);
  return points;
}

std::vector<ContactPoint> FindHullBoxContact(const Polyhedron& hull, const Pose& pose_WH,
                                             const Box& box, const Pose& pose_WB, double reach_m) {
  const PlacedBox placed(box, pose_WH.Inverse() * pose_WB);
  std::vector<ContactPoint> points = Pair(hull, placed).Find(reach_m);
  PutInWorld(pose_WH, points);
  return points;
}

}  // namespace rikiseki::world
