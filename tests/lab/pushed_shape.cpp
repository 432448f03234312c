// SPDX-License-Identifier: MIT
#include "tests/lab/pushed_shape.h"

#include <cmath>
#include <memory>
#include <numbers>
#include <vector>

#include "world_server/geometry/convex_hull.h"

namespace rikiseki::lab {
namespace {

constexpr double kCapsuleHalf = 0.02;  // m, without the caps
constexpr double kLongest = 0.04;      // m, of the ellipsoid
constexpr int kPillarSides = 8;

// Of 1 kg, about z and across.
Vec3 OfCylinder(double radius, double half_length) {
  const double across = (3 * radius * radius + 4 * half_length * half_length) / 12;
  return {across, across, radius * radius / 2};
}

Vec3 OfCapsule(double radius, double half_length) {
  const double length = 2 * half_length;
  const double cylinder = length / (length + 4 * radius / 3);
  const double caps = 1 - cylinder;
  const double about = cylinder * radius * radius / 2 + caps * 0.4 * radius * radius;
  const double across =
      cylinder * (3 * radius * radius + length * length) / 12 +
      caps * (0.4 * radius * radius + length * length / 4 + 3 * length * radius / 8);
  return {across, across, about};
}

Vec3 OfEllipsoid(const Vec3& radii) {
  const Vec3 squares = radii.cwiseAbs2();
  return (Vec3::Constant(squares.sum()) - squares) / 5;
}

// With two sides across the finger's way.
world::Hull Pillar() {
  const double outer = kCubeHalf / std::cos(std::numbers::pi / kPillarSides);
  std::vector<Vec3> corners;
  for (int i = 0; i < kPillarSides; ++i) {
    const double angle = 2 * std::numbers::pi * (i + 0.5) / kPillarSides;
    for (const double side : {-1.0, 1.0}) {
      corners.emplace_back(outer * std::cos(angle), outer * std::sin(angle), side * kCubeHalf);
    }
  }
  return {.mesh = std::make_shared<const world::TriangleMesh>(world::ConvexHull(corners))};
}

}  // namespace

const char* NameOf(PushedShape shape) {
  constexpr std::array kNames = {"cube",    "standing_cylinder", "lying_cylinder",
                                 "capsule", "ellipsoid",         "hull"};
  return kNames[static_cast<std::size_t>(shape)];
}

world::SceneBody MakePushed(PushedShape shape, double mass_kg, double friction,
                            const Vec3& position) {
  world::SceneBody body;
  body.name = NameOf(shape);
  body.mass_kg = mass_kg;
  body.pose_WB.position = position;
  world::Collider& collider = body.colliders.emplace_back();
  collider.friction = friction;
  Vec3 moments = Vec3::Constant(2 * kCubeHalf * kCubeHalf / 3);
  const Quat lying(Eigen::AngleAxisd(std::numbers::pi / 2, Vec3::UnitX()));
  switch (shape) {
    case PushedShape::kCube:
      collider.shape = world::Box{Vec3::Constant(kCubeHalf)};
      break;
    case PushedShape::kStandingCylinder:
    case PushedShape::kLyingCylinder:
      collider.shape = world::Cylinder{kCubeHalf, kCubeHalf};
      moments = OfCylinder(kCubeHalf, kCubeHalf);
      if (shape == PushedShape::kLyingCylinder) body.pose_WB.orientation = lying;
      break;
    case PushedShape::kCapsule:
      collider.shape = world::Capsule{kCubeHalf, kCapsuleHalf};
      moments = OfCapsule(kCubeHalf, kCapsuleHalf);
      body.pose_WB.orientation = lying;
      break;
    case PushedShape::kEllipsoid: {
      const Vec3 radii(kCubeHalf, kLongest, kCubeHalf);
      collider.shape = world::Ellipsoid{radii};
      moments = OfEllipsoid(radii);
      break;
    }
    case PushedShape::kHull:
      collider.shape = Pillar();
      moments = OfCylinder(kCubeHalf, kCubeHalf);
      break;
  }
  body.inertia = Vec3(mass_kg * moments).asDiagonal();
  return body;
}

}  // namespace rikiseki::lab
