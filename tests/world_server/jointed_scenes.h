// SPDX-License-Identifier: MIT
// Scenes with joints that several tests use.
#pragma once

#include <string>

#include "common/rigid_body.h"
#include "tests/world_server/scenes.h"

namespace rikiseki::world::test {

/// A box of uniform density.
inline SceneBody Block(const Vec3& size, double mass_kg, const Pose& pose_WB) {
  SceneBody block;
  block.name = "block::link";
  block.mass_kg = mass_kg;
  const Vec3 squares = size.cwiseProduct(size);
  block.inertia = (mass_kg / 12 * (Vec3::Constant(squares.sum()) - squares)).asDiagonal();
  block.pose_WB = pose_WB;
  block.colliders.push_back({.shape = Box{size / 2}, .friction = 0.5});
  return block;
}

/// A joint of two bodies at a place of W, z along `axis`.
inline Joint JoinAt(const Scene& scene, Joint::Type type, std::size_t parent, std::size_t child,
                    const Vec3& point_W, const Vec3& axis_W) {
  const Pose pose_WJ{.position = point_W,
                     .orientation = Quat::FromTwoVectors(Vec3::UnitZ(), axis_W)};
  const auto seen_from = [&](std::size_t body) {
    return body == Joint::kWorld ? pose_WJ : scene.bodies[body].pose_WB.Inverse() * pose_WJ;
  };
  return {.name = "joint",
          .type = type,
          .parent = parent,
          .child = child,
          .pose_PJ = seen_from(parent),
          .pose_CJ = seen_from(child)};
}

/// A door of 0.8 m x 2 m x 4 cm and 20 kg, upright, hinged to the world at its left edge, x = 0. It
/// opens about z.
inline Scene Door() {
  Scene scene;
  scene.name = "door";
  scene.bodies = {Block({0.8, 0.04, 2}, 20, {.position = {0.4, 0, 1}})};
  scene.joints = {
      JoinAt(scene, Joint::Type::kRevolute, Joint::kWorld, 0, {0, 0, 0.5}, Vec3::UnitZ())};
  return scene;
}
inline constexpr double kDoorInertia = 20 * (0.64 + 0.0016) / 12 + 20 * 0.16;  // about the hinge

/// A rod of 40 cm and 2 kg that hangs from the origin, turned out by `angle` about y.
inline Scene Pendulum(double angle) {
  const Quat turned(Eigen::AngleAxisd(angle, Vec3::UnitY()));
  Scene scene;
  scene.name = "pendulum";
  scene.bodies = {
      Block({0.02, 0.02, 0.4}, 2, {.position = turned * Vec3(0, 0, -0.2), .orientation = turned})};
  scene.joints = {
      JoinAt(scene, Joint::Type::kRevolute, Joint::kWorld, 0, Vec3::Zero(), Vec3::UnitY())};
  return scene;
}
inline constexpr double kPendulumInertia = 2 * (0.16 + 0.0004) / 12 + 2 * 0.04;  // about the pin

/// The largest distance of the two sides of any joint's anchor, and of a revolute's axes in rad.
inline double Apart(const Scene& scene, const std::vector<BodyState>& states) {
  double apart = 0;
  for (const Joint& joint : scene.joints) {
    const auto pose = [&](std::size_t body, const Pose& frame) {
      return body == Joint::kWorld ? frame : states[body].pose * frame;
    };
    const Pose parent = pose(joint.parent, joint.pose_PJ);
    const Pose child = pose(joint.child, joint.pose_CJ);
    Vec3 between = child.position - parent.position;
    const Vec3 axis = parent.orientation * Vec3::UnitZ();
    if (joint.type == Joint::Type::kPrismatic) between -= between.dot(axis) * axis;
    apart = std::max(apart, between.norm());
    if (joint.type == Joint::Type::kBall) continue;
    apart = std::max(apart, (child.orientation * Vec3::UnitZ() - axis).norm());
    if (joint.type == Joint::Type::kPrismatic) {
      apart = std::max(apart, parent.orientation.angularDistance(child.orientation));
    }
  }
  return apart;
}

}  // namespace rikiseki::world::test
