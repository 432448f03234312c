// SPDX-License-Identifier: MIT
#include "world_server/physics/placed_cylinder.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace rikiseki::world {
namespace {

constexpr int kRimPoints = 8;
constexpr int kCapSides = 16;    // of the polygon round a cap
constexpr double kOnSide = 0.1;  // sine: raised by more, it rolls on its rim

}  // namespace

PlacedCylinder::PlacedCylinder(const Cylinder& cylinder, const Pose& pose)
    : centre(pose.position),
      axes(pose.orientation.toRotationMatrix()),
      axis(axes.col(2)),
      radius(cylinder.radius),
      half_length(cylinder.half_length) {}

double PlacedCylinder::Extent(const Vec3& direction) const {
  const double along = axis.dot(direction);
  return half_length * std::abs(along) + radius * std::sqrt(std::max(0.0, 1 - along * along));
}

Polygon PlacedCylinder::Side(const Vec3& normal) const {
  const Vec3 across = normal - axis.dot(normal) * axis;
  const Vec3 middle = centre - radius * across.normalized();
  const Vec3 along = CapSide(normal) * half_length * axis;
  return {middle + along, middle - along};
}

// Always the same points of the cap, counter-clockwise about the axis.
Polygon PlacedCylinder::Cap(const Vec3& normal) const {
  const Vec3 middle = centre + CapSide(normal) * half_length * axis;
  Polygon rim;
  for (int i = 0; i < kRimPoints; ++i) {
    const double angle = 2 * std::numbers::pi * i / kRimPoints;
    rim.push_back(middle +
                  radius * (std::cos(angle) * axes.col(0) + std::sin(angle) * axes.col(1)));
  }
  return rim;
}

std::vector<Polygon> PlacedCylinder::Against(const Vec3& normal) const {
  const double sine = Sine(normal);
  if (sine >= kOverCap) return {Side(normal)};
  std::vector<Polygon> found = {Cap(normal)};
  if (sine > kFlatCap) found.push_back({Side(normal)[0]});
  return found;
}

double PlacedCylinder::RoundingAgainst(const Vec3& normal) const {
  return std::abs(axis.dot(normal)) <= kOnSide ? radius : 0;
}

Polygon PlacedCylinder::RoundCap(const Vec3& direction) const {
  const double side = -CapSide(direction);
  const Vec3 middle = centre + side * half_length * axis;
  const double outer = radius / std::cos(std::numbers::pi / kCapSides);
  Polygon polygon;
  for (int i = 0; i < kCapSides; ++i) {
    const double angle = side * 2 * std::numbers::pi * (i + 0.5) / kCapSides;
    polygon.push_back(middle +
                      outer * (std::cos(angle) * axes.col(0) + std::sin(angle) * axes.col(1)));
  }
  return polygon;
}

}  // namespace rikiseki::world
