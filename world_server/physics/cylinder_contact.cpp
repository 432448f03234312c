// SPDX-License-Identifier: MIT
#include "world_server/physics/cylinder_contact.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "world_server/physics/placed_cylinder.h"

namespace rikiseki::world {
namespace {

constexpr double kSharp = 1e-6;      // sine: more parallel, a support is an edge and not a corner
constexpr double kAlongEdge = 1e-3;  // sine: the side lies along an edge, not across it
constexpr int kDirections = 32;      // looked at round an edge before the best is refined
constexpr int kRefinements = 40;     // golden sections: 0.2 rad to 1e-9

// Out of the box, towards the cylinder; > 0: so far apart at least.
struct Separation {
  Vec3 normal = Vec3::UnitZ();
  double distance = -std::numeric_limits<double>::infinity();
};

class Pair {
 public:
  Pair(const PlacedCylinder& cylinder, const PlacedBox& box, double reach)
      : cylinder_(cylinder),
        box_(box),
        reach_(reach),
        between_(cylinder.centre - box.centre),
        margin_(kEdgeMargin *
                std::min({box.half.minCoeff(), cylinder.radius, cylinder.half_length})) {}

  std::vector<ContactPoint> Find() {
    Separation face;
    int face_axis = 0;
    for (int i = 0; i < 3; ++i) {
      const Separation found = Either(box_.axes.col(i));
      if (found.distance <= face.distance) continue;
      face = found;
      face_axis = i;
    }
    const Separation cap = Either(cylinder_.axis);
    const double flat = std::max(face.distance, cap.distance);
    if (flat > reach_) return {};
    const Separation edge = BestEdge();
    if (edge.distance > reach_) return {};
    if (edge.distance > flat + margin_) {
      AddEdge(edge);
    } else if (face.distance >= cap.distance - margin_) {
      AddFace(face.normal, face_axis);
    } else {
      AddCap(cap.normal);
    }
    // Beside a face, though no edge is clearly the better axis.
    if (points_.empty() && cylinder_.Sine(edge.normal) > kFlatCap) AddEdge(edge);
    std::erase_if(points_, [&](const ContactPoint& point) { return !(point.gap <= reach_); });
    KeepSome(points_);
    return points_;
  }

 private:
  static bool Nearer(const Separation& a, const Separation& b) { return a.distance < b.distance; }

  Separation Along(const Vec3& normal) const {
    return {normal, normal.dot(between_) - box_.Extent(normal) - cylinder_.Extent(normal)};
  }
  Separation Either(const Vec3& axis) const {
    return Along(axis.dot(between_) >= 0 ? axis : Vec3(-axis));
  }

  Separation BestEdge() const {
    Separation best;
    const auto consider = [&](const Separation& found) { best = std::max(best, found, Nearer); };
    for (int i = 0; i < 3; ++i) {
      const Vec3 edge = box_.axes.col(i);
      const Vec3 across = cylinder_.axis.cross(edge);
      if (across.norm() > kAlongEdge) consider(Either(across.normalized()));
      consider(RoundEdge(box_.axes.col((i + 1) % 3), box_.axes.col((i + 2) % 3)));
    }
    // The side against a corner.
    for (int i = 0; i < 8; ++i) {
      const Vec3 sign((i & 1) != 0 ? 1 : -1, (i & 2) != 0 ? 1 : -1, (i & 4) != 0 ? 1 : -1);
      const Vec3 corner = box_.centre + box_.axes * sign.cwiseProduct(box_.half);
      const Vec3 out = FromAxis(corner);
      if (out.norm() > kSharp * cylinder_.radius) consider(Along(-out.normalized()));
    }
    return best;
  }

  // The best direction at right angles to an edge; there an edge meets the rim.
  Separation RoundEdge(const Vec3& u, const Vec3& v) const {
    const auto at = [&](double angle) { return Along(std::cos(angle) * u + std::sin(angle) * v); };
    const double spacing = 2 * std::numbers::pi / kDirections;
    double best = 0;
    double distance = -std::numeric_limits<double>::infinity();
    for (int i = 0; i < kDirections; ++i) {
      const double found = at(i * spacing).distance;
      if (found <= distance) continue;
      distance = found;
      best = i * spacing;
    }
    constexpr double kGolden = 1 / std::numbers::phi;
    double low = best - spacing;
    double high = best + spacing;
    double left = high - kGolden * (high - low);
    double right = low + kGolden * (high - low);
    double at_left = at(left).distance;
    double at_right = at(right).distance;
    for (int i = 0; i < kRefinements; ++i) {
      if (at_left < at_right) {
        low = left;
        left = std::exchange(right, low + kGolden * (high - low));
        at_left = std::exchange(at_right, at(right).distance);
      } else {
        high = right;
        right = std::exchange(left, high - kGolden * (high - low));
        at_right = std::exchange(at_left, at(left).distance);
      }
    }
    return at((low + high) / 2);
  }

  Vec3 FromAxis(const Vec3& point) const {
    const Vec3 relative = point - cylinder_.centre;
    return relative - cylinder_.axis.dot(relative) * cylinder_.axis;
  }

  void AddFace(const Vec3& normal, int axis) {
    const double face = normal.dot(box_.centre) + box_.half[axis];
    const double rounding = cylinder_.RoundingAgainst(normal);
    for (const Polygon& polygon : cylinder_.Against(normal)) {
      for (const Vec3& point : ClipToFace(polygon, box_, axis)) {
        points_.push_back({point, normal, normal.dot(point) - face, rounding});
      }
    }
    if (points_.empty() && cylinder_.Sine(normal) < kOverCap) AddRim(normal, face);
  }

  // The face's edge reaches under the cap between two of its eight points.
  void AddRim(const Vec3& normal, double face) {
    const Vec3 middle =
        cylinder_.centre + cylinder_.CapSide(normal) * cylinder_.half_length * cylinder_.axis;
    const Vec3 local = box_.axes.transpose() * (middle - box_.centre);
    const Vec3 inside = box_.centre + box_.axes * local.cwiseMax(-box_.half).cwiseMin(box_.half);
    const Vec3 out = FromAxis(inside);
    if (out.norm() > cylinder_.radius) return;
    const Vec3 point = middle + out;
    points_.push_back({point, normal, normal.dot(point) - face});
  }

  void AddCap(const Vec3& normal) {
    const Vec3 middle = cylinder_.centre - cylinder_.half_length * normal;
    for (const Vec3& point :
         ClipToBorder(box_.FaceAgainst(-normal), cylinder_.RoundCap(-normal), -normal)) {
      const double gap = normal.dot(middle - point);
      points_.push_back({point + gap * normal, normal, gap});
    }
  }

  // A corner or an edge of the box against the side or the rim.
  void AddEdge(const Separation& found) {
    const Vec3& normal = found.normal;
    const Polygon side = cylinder_.Side(normal);
    const Vec3 corner = box_.Corner(normal);
    const bool on_side = std::abs(cylinder_.axis.dot(normal)) < kSharp;
    int sharpest = 0;
    (box_.axes.transpose() * normal).cwiseAbs().minCoeff(&sharpest);
    const Vec3 edge = box_.axes.col(sharpest);
    const bool on_edge = std::abs(edge.dot(normal)) < kSharp;
    if (on_side && cylinder_.axis.cross(edge).norm() < kAlongEdge) {
      AddLine(corner, edge, 2 * box_.half[sharpest]);
    } else if (on_side && on_edge) {
      const Vec3 point = NearestOnSegment((side[0] + side[1]) / 2, cylinder_.axis,
                                          cylinder_.half_length, corner, edge);
      points_.push_back({point, normal, found.distance});
    } else if (on_side) {
      points_.push_back({corner + found.distance * normal, normal, found.distance});
    } else {
      points_.push_back({side[0], normal, found.distance});
    }
  }

  // The side along an edge of the box: the two ends of what they have in common.
  void AddLine(const Vec3& corner, const Vec3& edge, double length) {
    const Vec3 direction = edge.dot(corner - box_.centre) > 0 ? Vec3(-edge) : edge;
    const double middle = cylinder_.axis.dot(cylinder_.centre);
    Polygon line = {corner, corner + length * direction};
    line = Clip(line, cylinder_.axis, middle + cylinder_.half_length);
    line = Clip(line, -cylinder_.axis, cylinder_.half_length - middle);
    for (const Vec3& point : line) {
      const Vec3 out = FromAxis(point);
      const double distance = out.norm();
      const Vec3 normal = -out / distance;
      const double gap = distance - cylinder_.radius;
      points_.push_back({point + gap * normal, normal, gap});
    }
  }

  const PlacedCylinder& cylinder_;
  const PlacedBox& box_;
  double reach_;
  Vec3 between_;
  double margin_;
  std::vector<ContactPoint> points_;
};

}  // namespace

std::vector<ContactPoint> FindCylinderBoxContact(const Cylinder& cylinder, const Pose& pose_WC,
                                                 const Box& box, const Pose& pose_WB,
                                                 double reach_m) {
  const PlacedCylinder placed_cylinder(cylinder, pose_WC);
  const PlacedBox placed_box(box, pose_WB);
  return Pair(placed_cylinder, placed_box, reach_m).Find();
}

}  // namespace rikiseki::world
