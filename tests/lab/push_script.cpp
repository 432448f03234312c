// SPDX-License-Identifier: MIT
#include "tests/lab/push_script.h"

#include <algorithm>

namespace rikiseki::lab {
namespace {

constexpr double kApproach = 0.005;      // m, between finger and cube at the start
constexpr double kFast = 0.3;            // m/s
constexpr double kSlow = 0.1;            // m/s
constexpr double kHoldTime = 1.5;        // s, on the way in
constexpr double kSqueezeDepth = 0.002;  // m, of press and wall, and in the corner's floor
constexpr double kStickForce = 1;        // N
const Vec3 kWallHalf(0.5, 1, 0.5);       // m

// How deep the finger goes [m] past the face that it meets.
double Depth(const CubePush& push) {
  switch (push.script) {
    case PushScript::kPush:
    case PushScript::kOffCentre:
    case PushScript::kNeighbour:
    case PushScript::kCorner:
    case PushScript::kStack:
      return 0.015;
    case PushScript::kPoke:
      return 0.005;
    case PushScript::kHold:
      return kHoldTime * kSlow - kApproach;
    case PushScript::kPress:
      return kSqueezeDepth;
    case PushScript::kWall:
      return push.gap_m + kSqueezeDepth;
    case PushScript::kStick:
      return kStickForce / push.stiffness_n_per_m;
  }
  return 0;
}

bool ComesBack(PushScript script) {
  return script == PushScript::kPush || script == PushScript::kPoke ||
         script == PushScript::kOffCentre || script == PushScript::kNeighbour ||
         script == PushScript::kCorner || script == PushScript::kStack;
}

world::SceneBody Body(const char* name, const world::Shape& shape, const Vec3& position,
                      double friction) {
  world::SceneBody body;
  body.name = name;
  body.fixed = true;
  body.pose_WB.position = position;
  body.colliders.push_back({.shape = shape, .friction = friction});
  return body;
}

}  // namespace

double Duration(const CubePush& push) {
  switch (push.script) {
    case PushScript::kPress:
      return (kApproach + kSqueezeDepth) / kSlow + 1;
    case PushScript::kHold:
      return kHoldTime + 0.5;
    case PushScript::kWall:
      return (kApproach + Depth(push)) / kSlow + 1.73;
    case PushScript::kStick:
      return 5;
    default:
      return 1.5;
  }
}

Vec3 FingerPosition(const CubePush& push, const Vec3& cube, double t_s) {
  const double way = kApproach + Depth(push);
  double gone = 0;
  if (ComesBack(push.script)) {
    gone = t_s * kFast < way ? t_s * kFast : std::max(0.0, 2 * way - t_s * kFast);
  } else {
    gone = std::min(way, t_s * kSlow);
  }
  const Vec3 inwards = push.script == PushScript::kPress ? Vec3(-Vec3::UnitZ()) : Vec3::UnitX();
  Vec3 finger = cube + push.offset_m * Vec3::UnitY() +
                (gone - kApproach - kFingerRadius - kCubeHalf) * inwards;
  if (push.script == PushScript::kCorner) finger.z() = kFingerRadius - kSqueezeDepth;
  return finger;
}

world::Scene PushScene(const CubePush& push) {
  world::Scene scene;
  scene.name = "push";
  scene.bodies.push_back(MakePushed(push.shape, push.mass_kg, push.friction, {0, 0, kCubeHalf}));
  scene.bodies.push_back(Body("floor", world::HalfSpace{}, Vec3::Zero(), push.friction));
  if (push.script == PushScript::kWall) {
    const Vec3 position(kCubeHalf + push.gap_m + kWallHalf.x(), 0, kWallHalf.z());
    scene.bodies.push_back(Body("wall", world::Box{kWallHalf}, position, push.friction));
  } else if (push.script == PushScript::kNeighbour) {
    scene.bodies.push_back(MakePushed(PushedShape::kCube, push.neighbour_kg, push.friction,
                                      {2 * kCubeHalf + push.gap_m, 0, kCubeHalf}));
    scene.bodies.back().name = "neighbour";
  } else if (push.script == PushScript::kStack) {
    scene.bodies.push_back(
        MakePushed(PushedShape::kCube, push.neighbour_kg, push.friction, {0, 0, 3 * kCubeHalf}));
    scene.bodies.back().name = "on top";
  }
  return scene;
}

}  // namespace rikiseki::lab
