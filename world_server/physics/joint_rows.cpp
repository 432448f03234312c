// SPDX-License-Identifier: MIT
#include "world_server/physics/joint_rows.h"

#include <cmath>

namespace rikiseki::world {
namespace {

// Of the child's anchor against the parent, along an axis that the parent carries, or W.
JointRow Along(const JointFrames& frames, const Vec3& axis, const Vec3& parent_anchor) {
  const Vec3& anchor = frames.child_WJ.position;
  return {.linear = axis,
          .angular_child = (anchor - frames.child_centre).cross(axis),
          .angular_parent = -(parent_anchor - frames.parent_centre).cross(axis),
          .position = axis.dot(anchor - frames.parent_WJ.position)};
}

JointRow About(const Vec3& axis, double position) {
  return {.angular_child = axis, .angular_parent = -axis, .position = position};
}

// The child's attitude in the parent's, by the shorter way.
Quat Turn(const JointFrames& frames) {
  Quat turn = frames.parent_WJ.orientation.conjugate() * frames.child_WJ.orientation;
  if (turn.w() < 0) turn.coeffs() *= -1;
  return turn;
}

}  // namespace

void AppendHeldRows(Joint::Type type, const JointFrames& frames, std::vector<JointRow>& rows) {
  const Mat3 parent_axes = frames.parent_WJ.orientation.toRotationMatrix();
  if (type == Joint::Type::kPrismatic) {
    const Quat turn = Turn(frames);
    for (int i = 0; i < 3; ++i) rows.push_back(About(parent_axes.col(i), 2 * turn.vec()[i]));
    // The axis turns with the parent: its lever reaches as far as the child's anchor.
    for (int i = 0; i < 2; ++i) {
      rows.push_back(Along(frames, parent_axes.col(i), frames.child_WJ.position));
    }
    return;
  }
  for (int i = 0; i < 3; ++i) {
    rows.push_back(Along(frames, Vec3::Unit(i), frames.parent_WJ.position));
  }
  if (type == Joint::Type::kBall) return;
  const Vec3 axis = frames.child_WJ.orientation * Vec3::UnitZ();
  for (int i = 0; i < 2; ++i) {
    const Vec3 across = parent_axes.col(i);
    rows.push_back(About(axis.cross(across), across.dot(axis)));
  }
}

JointRow FreeRow(Joint::Type type, const JointFrames& frames) {
  const Vec3 axis = frames.parent_WJ.orientation * Vec3::UnitZ();
  if (type == Joint::Type::kPrismatic) return Along(frames, axis, frames.child_WJ.position);
  const Quat turn = Turn(frames);
  return About(axis, 2 * std::atan2(turn.z(), turn.w()));
}

}  // namespace rikiseki::world
