// SPDX-License-Identifier: MIT
#include "world_server/physics/convex_contact.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "world_server/physics/gjk.h"

namespace rikiseki::world {
namespace {

constexpr double kFaceMargin = 1e-9;  // m: of two equal faces the second shape's is the reference
constexpr double kAlongLine = 1e-3;   // sine: more parallel, lines share a length and not a point
constexpr double kFacing = 0.7;  // cosine: a face that looks elsewhere is not the one that touches
constexpr double kPull = 1e-2;   // of the smaller shape: how far overlapping ones are pulled apart
constexpr int kMostPulls = 8;
constexpr double kGain = 1e-10;  // of the smaller shape: less is no better axis

double Smaller(const PlacedConvex& first, const PlacedConvex& second) {
  return std::min(first.thinnest(), second.thinnest());
}

class Points {
 public:
  Points(const PlacedConvex& first, const PlacedConvex& second, const ContactAxis& axis)
      : first_(first), second_(second), axis_(axis) {}

  std::vector<ContactPoint> Find(double reach) {
    const double margin = kEdgeMargin * Smaller(first_, second_);
    const std::optional<FlatFace> of_first = Facing(first_.FaceAlong(-axis_.normal), -axis_.normal);
    const std::optional<FlatFace> of_second = Facing(second_.FaceAlong(axis_.normal), axis_.normal);
    const double least = axis_.separation - margin;
    const double first_apart = of_first ? Separation(first_, second_, -of_first->normal) : -1e300;
    const double second_apart = of_second ? Separation(first_, second_, of_second->normal) : -1e300;
    if (second_apart >= least && second_apart >= first_apart - kFaceMargin) {
      AddOverSecond(*of_second);
    } else if (first_apart >= least) {
      AddOverFirst(*of_first);
    }
    if (points_.empty()) AddLine();
    std::erase_if(points_, [&](const ContactPoint& point) { return !(point.gap <= reach); });
    KeepSome(points_);
    return points_;
  }

 private:
  static std::optional<FlatFace> Facing(std::optional<FlatFace> face, const Vec3& direction) {
    if (face && face->normal.dot(direction) < kFacing) face.reset();
    return face;
  }

  // A core's point along a normal, on the rounded surface.
  void Add(const Vec3& of_core, const Vec3& normal, double core_gap) {
    points_.push_back({.point_W = of_core - first_.radius() * normal,
                       .normal_W = normal,
                       .gap = core_gap - first_.radius() - second_.radius(),
                       .radius = first_.RoundingAgainst(normal)});
  }

  void AddOverSecond(const FlatFace& face) {
    for (const Polygon& polygon : first_.Against(face.normal)) {
      for (const Vec3& point : ClipToBorder(polygon, face.border, face.normal)) {
        Add(point, face.normal, face.normal.dot(point) - face.offset);
      }
    }
  }

  void AddOverFirst(const FlatFace& face) {
    const Vec3 normal = -face.normal;
    for (const Polygon& polygon : second_.Against(face.normal)) {
      for (const Vec3& point : ClipToBorder(polygon, face.border, face.normal)) {
        const double gap = face.normal.dot(point) - face.offset;
        Add(point + gap * normal, normal, gap);
      }
    }
  }

  void AddLine() {
    const Vec3& normal = axis_.normal;
    const Polygon first = first_.LineAgainst(normal);
    const Polygon second = second_.LineAgainst(-normal);
    if (first.size() == 2 && second.size() == 2) {
      const Vec3 along = (first[1] - first[0]).normalized();
      const Vec3 other = second[1] - second[0];
      const double length = along.dot(other);
      if (along.cross(other).norm() < kAlongLine * std::abs(length)) {
        Polygon line = Clip(first, along, std::max(along.dot(second[0]), along.dot(second[1])));
        line = Clip(line, -along, -std::min(along.dot(second[0]), along.dot(second[1])));
        for (const Vec3& point : line) {
          const Vec3 beside = second[0] + along.dot(point - second[0]) / length * other;
          Add(point, normal, normal.dot(point - beside));
        }
        if (!points_.empty()) return;
      }
    }
    Add(axis_.on_first, normal, axis_.separation + first_.radius() + second_.radius());
  }

  const PlacedConvex& first_;
  const PlacedConvex& second_;
  const ContactAxis& axis_;
  std::vector<ContactPoint> points_;
};

}  // namespace

double Separation(const PlacedConvex& first, const PlacedConvex& second, const Vec3& normal) {
  return normal.dot(first.Support(-normal) - second.Support(normal)) - first.radius() -
         second.radius();
}

ContactAxis FindContactAxis(const PlacedConvex& first, const PlacedConvex& second, double reach_m) {
  ContactAxis best{.separation = -1e300};
  const auto consider = [&](const Vec3& normal) {
    const double separation = Separation(first, second, normal);
    if (separation <= best.separation) return;
    best = {normal, separation, first.Support(-normal), second.Support(normal)};
  };
  const Vec3 between = first.centre() - second.centre();
  consider(between.norm() > 0 ? Vec3(between.normalized()) : Vec3::UnitZ());
  for (const Vec3& normal : second.FaceNormals()) consider(normal);
  for (const Vec3& normal : first.FaceNormals()) consider(-normal);
  if (best.separation > reach_m) return best;

  // Cores that overlap are pulled apart along the best direction so far; the nearest points then
  // show one that is at least as good. Each pull is small beside the shapes, so few are enough.
  const double smaller = Smaller(first, second);
  const double roundings = first.radius() + second.radius();
  for (int i = 0; i < kMostPulls; ++i) {
    const double core_apart = best.separation + roundings;
    const double pull = std::max(0.0, kPull * smaller - core_apart);
    const Vec3 shift = pull * best.normal;
    const Closest closest = FindClosest(
        [&](const Vec3& direction) {
          return Simplex::Pair{first.Support(direction) + shift, second.Support(-direction)};
        },
        best.normal);
    if (!closest.apart) break;
    ContactAxis found;
    found.normal = (closest.on_first - closest.on_second).normalized();
    found.separation = Separation(first, second, found.normal);
    found.on_first = closest.on_first - shift;
    found.on_second = closest.on_second;
    const double gain = found.separation - best.separation;
    if (gain > -kGain * smaller) best = found;
    if (pull == 0 || gain < kGain * smaller) break;
  }
  return best;
}

std::vector<ContactPoint> PointsAlong(const PlacedConvex& first, const PlacedConvex& second,
                                      const ContactAxis& axis, double reach_m) {
  return Points(first, second, axis).Find(reach_m);
}

std::vector<ContactPoint> FindConvexContact(const PlacedConvex& first, const PlacedConvex& second,
                                            double reach_m) {
  const ContactAxis axis = FindContactAxis(first, second, reach_m);
  if (axis.separation > reach_m) return {};
  return PointsAlong(first, second, axis, reach_m);
}

}  // namespace rikiseki::world
