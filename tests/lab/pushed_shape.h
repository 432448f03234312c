// SPDX-License-Identifier: MIT
// What stands on the laboratory's floor to be touched: shapes that all fill a cube of 6 cm along the ways
// of the finger, so that one script serves them all.
#pragma once

#include <array>

#include "world_server/scene/scene.h"

namespace rikiseki::lab {

inline constexpr double kCubeHalf = 0.03;  // m

enum class PushedShape {
  kCube,
  kStandingCylinder,
  kLyingCylinder,  // rolls along x
  kCapsule,        // lies, rolls along x
  kEllipsoid,      // longest along y
  kHull,           // an eight-sided pillar that stands
};
inline constexpr std::array kPushedShapes = {
    PushedShape::kCube,    PushedShape::kStandingCylinder, PushedShape::kLyingCylinder,
    PushedShape::kCapsule, PushedShape::kEllipsoid,        PushedShape::kHull};

const char* NameOf(PushedShape shape);

/// A body of that shape, its middle at `position`, homogeneous but for the hull, whose inertia is its
/// round pillar's.
world::SceneBody MakePushed(PushedShape shape, double mass_kg, double friction,
                            const Vec3& position);

}  // namespace rikiseki::lab
