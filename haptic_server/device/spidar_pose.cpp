// SPDX-License-Identifier: MIT
#include "haptic_server/device/spidar_pose.h"

#include <Eigen/Cholesky>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace rikiseki::haptic {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

constexpr int kMaxIterations = 5;
// m: each step is the square of the one before over some centimetres, and, of lengths that do not
// quite agree, a thousandth of it. After a step as short as this nothing is left to gain.
constexpr double kConverged = 1e-9;
constexpr double kLongestTurn = 0.5;  // rad, of a step: beyond, the strings' directions are others
constexpr double kShortestString = 1e-9;     // m
constexpr double kLeastStiffness = 1e-3;     // weakest to strongest direction at home; a G6 has 0.3
constexpr std::size_t kNone = kGripStrings;  // leaves out no string

// Turns `q` by a rotation vector in device axes.
Quat Turned(const Quat& q, const Vec3& turn) {
  const double angle = turn.norm();
  if (!(angle > 0)) return q;
  return (Quat(Eigen::AngleAxisd(angle, turn / angle)) * q).normalized();
}

}  // namespace

SpidarPose::SpidarPose(const std::array<Vec3, kGripStrings>& motors,
                       const std::array<Vec3, kGripStrings>& attachments)
    : motors_(motors), attachments_(attachments) {
  double square = 0;
  for (const Vec3& attachment : attachments) square += attachment.squaredNorm() / kGripStrings;
  mean_arm_m_ = std::sqrt(square);
  const GripStrings home = StringsAt(Pose());
  Matrix6 stiffness = Matrix6::Zero();
  for (std::size_t i = 0; i < kGripStrings; ++i) {
    Vector6 row;
    row << home.direction[i], home.arm[i].cross(home.direction[i]) / mean_arm_m_;
    stiffness += row * row.transpose();
  }
  const Vector6 by_size = stiffness.jacobiSvd().singularValues();
  if (!stiffness.allFinite() || !(by_size[5] > kLeastStiffness * by_size[0])) {
    throw std::invalid_argument("the eight strings do not fix the grip in all six directions");
  }
}

EightStrings SpidarPose::Lengths(const Pose& pose) const noexcept {
  EightStrings lengths;
  for (std::size_t i = 0; i < kGripStrings; ++i) {
    lengths[i] = (motors_[i] - pose * attachments_[i]).norm();
  }
  return lengths;
}

GripStrings SpidarPose::StringsAt(const Pose& pose) const noexcept {
  GripStrings strings;
  for (std::size_t i = 0; i < kGripStrings; ++i) {
    strings.arm[i] = pose.orientation * attachments_[i];
    strings.direction[i] = (motors_[i] - pose.position - strings.arm[i]).stableNormalized();
  }
  return strings;
}

SpidarPose::Fix SpidarPose::Solve(const EightStrings& lengths, const Pose& start) const noexcept {
  return SolveWithout(kNone, lengths, start);
}

SpidarPose::Fix SpidarPose::SolveWithout(std::size_t left_out, const EightStrings& lengths,
                                         const Pose& start) const noexcept {
  Fix fix;
  fix.pose = start;
  for (;;) {
    const Mat3 rotation = fix.pose.orientation.toRotationMatrix();
    Matrix6 normal_matrix = Matrix6::Zero();
    Vector6 gradient = Vector6::Zero();
    fix.residual_m = 0;
    for (std::size_t i = 0; i < kGripStrings; ++i) {
      if (i == left_out) continue;
      const Vec3 arm = rotation * attachments_[i];
      const Vec3 string = fix.pose.position + arm - motors_[i];
      const double length = std::max(string.norm(), kShortestString);
      const Vec3 direction = string / length;
      const double miss = length - lengths[i];
      Vector6 row;
      row << direction, arm.cross(direction) / mean_arm_m_;
      normal_matrix.noalias() += row * row.transpose();
      gradient += row * miss;
      fix.residual_m = std::max(fix.residual_m, std::abs(miss));
    }
    if (fix.iterations == kMaxIterations) return fix;
    Vector6 step = normal_matrix.llt().solve(gradient);
    if (!step.allFinite()) {  // a length is no number, which no maximum shows
      fix.residual_m = std::numeric_limits<double>::infinity();
      return fix;
    }
    const double turn = step.tail<3>().norm() / mean_arm_m_;
    if (turn > kLongestTurn) step *= kLongestTurn / turn;
    fix.pose.position -= step.head<3>();
    fix.pose.orientation = Turned(fix.pose.orientation, -step.tail<3>() / mean_arm_m_);
    ++fix.iterations;
    if (step.norm() < kConverged) return fix;  // the residual has changed by no more
  }
}

SuspectString SpidarPose::Suspect(const EightStrings& lengths, const Pose& start) const noexcept {
  SuspectString suspect;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < kGripStrings; ++i) {
    const Fix fix = SolveWithout(i, lengths, start);
    if (!(fix.residual_m < least)) continue;
    least = fix.residual_m;
    suspect = {i, lengths[i] - Lengths(fix.pose)[i]};
  }
  return suspect;
}

}  // namespace rikiseki::haptic
