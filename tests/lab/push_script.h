// SPDX-License-Identifier: MIT
// The block pushes of numerics section 5: a 6 cm cube on a floor, and what a finger sphere of 1 cm
// does to it, however it resists. World axes: x the way of the push, z up, the floor at z = 0.
#pragma once

#include "common/geometry.h"
#include "tests/lab/pushed_shape.h"
#include "world_server/scene/scene.h"

namespace rikiseki::lab {

inline constexpr double kFingerRadius = 0.01;  // m

enum class PushScript {
  kPush,       // in at 0.3 m/s to 15 mm past the initial face, and out again
  kPoke,       // the same to 5 mm
  kHold,       // in at 0.1 m/s for 1.5 s, and stay
  kPress,      // from above at 0.1 m/s to 2 mm into the top face, and stay
  kOffCentre,  // push beside the middle of the face
  kWall,       // in at 0.1 m/s, until the cube is squeezed 2 mm deep against a wall behind it
  kNeighbour,  // push, with another cube behind this one
  kStick,      // in at 0.1 m/s to a force of 1 N, and stay for 5 s
  kCorner,     // push while the finger is 2 mm deep in the floor: two planes at once
  kStack,      // push, with another cube on top of this one
};

/// What is pushed, and how.
struct CubePush {
  PushScript script = PushScript::kPush;
  PushedShape shape = PushedShape::kCube;
  double mass_kg = 1;
  double friction = 0.3;  // of all pairs
  double stiffness_n_per_m = 2000;
  double damping_ns_per_m = 0;
  double offset_m = 0;      // of the finger's path, along y
  double gap_m = 0.02;      // between the cube and what stands behind it
  double neighbour_kg = 1;  // of the cube behind it, or on top
};

/// How long the script is watched [s].
double Duration(const CubePush& push);

/// The centre of the finger [m, in W] at `t_s` >= 0; `cube` is where the cube's centre rests.
Vec3 FingerPosition(const CubePush& push, const Vec3& cube, double t_s);

/// Body 0 is the cube, or what stands in its place, body 1 the floor; body 2, if the script has one, the wall or the
/// neighbour.
world::Scene PushScene(const CubePush& push);

}  // namespace rikiseki::lab
