// SPDX-License-Identifier: MIT
#include "haptic_server/device/spidar_grip.h"

#include <stdexcept>
#include <utility>

#include "haptic_server/device/hand.h"

namespace rikiseki::haptic {
namespace {

// rad, axis times angle, device axes: what turns `from` into `to` on the shorter way.
Vec3 RotationVector(const Quat& from, const Quat& to) {
  const Eigen::AngleAxisd turn(to * from.conjugate());
  return turn.angle() * turn.axis();
}

}  // namespace

SpidarPose GripKinematics(const SpidarSettings& settings) {
  if (settings.motors_m.size() != kGripStrings || settings.attachments_mm.size() != kGripStrings) {
    throw std::invalid_argument("a grip is held by 8 motors, each with its attachment");
  }
  std::array<Vec3, kGripStrings> motors;
  std::array<Vec3, kGripStrings> attachments;
  for (std::size_t string = 0; string < kGripStrings; ++string) {
    motors[string] = settings.motors_m[string];
    attachments[string] = 1e-3 * settings.attachments_mm[string];
  }
  return {motors, attachments};
}

SpidarGrip::SpidarGrip(const SpidarSettings& settings, std::unique_ptr<MotorBoard> board)
    : settings_(settings),
      board_(std::move(board)),
      kinematics_(GripKinematics(settings)),
      home_lengths_(kinematics_.Lengths(Pose())) {}

DeviceStatus SpidarGrip::Read(std::int64_t now_ns, DeviceSample& sample) noexcept {
  EncoderCounts counts{};
  if (!board_->ReadCounts(now_ns, counts)) {
    is_sound_ = false;
    velocity_.Restart();
    angular_velocity_.Restart();
    return DeviceStatus::kFault;
  }
  sample.enabled = board_->Enabled();
  EightStrings lengths;
  for (std::size_t string = 0; string < kGripStrings; ++string) {
    lengths[string] =
        home_lengths_[string] + static_cast<double>(counts[string]) * settings_.count_length_m;
  }
  SpidarPose::Fix fix = kinematics_.Solve(lengths, pose_);
  if (!is_sound_) {  // the grip may have gone far since the last sound pose: home is a second start
    const SpidarPose::Fix from_home = kinematics_.Solve(lengths, Pose());
    if (from_home.residual_m < fix.residual_m) fix = from_home;
  }
  if (!(fix.residual_m <= kSlipResidual)) {
    is_sound_ = false;
    velocity_.Restart();
    angular_velocity_.Restart();
    // Once, when the strings first disagree: the nearer the pose before, the surer the name.
    if (wrong_string_.is_clear()) wrong_string_.Blame(kinematics_.Suspect(lengths, pose_));
    return DeviceStatus::kFault;
  }
  is_sound_ = true;
  wrong_string_.Clear();
  const double cutoff_hz = settings_.velocity_cutoff_hz;
  sample.velocity = velocity_.Update(now_ns, fix.pose.position - pose_.position, cutoff_hz);
  sample.angular_velocity = angular_velocity_.Update(
      now_ns, RotationVector(pose_.orientation, fix.pose.orientation), cutoff_hz);
  pose_ = fix.pose;
  sample.position = pose_.position;
  sample.orientation = pose_.orientation;
  sample.target = board_->hand() != nullptr ? board_->hand()->target() : pose_.position;
  return DeviceStatus::kOk;
}

Vec3 SpidarGrip::Write(const Vec3& force) noexcept {
  const TensionBounds bounds{settings_.tension_min_n, settings_.tension_max_n};
  // No more than must be at a grip of which nothing is known.
  const double rest_n = is_sound_ ? settings_.rest_tension_n : bounds.min_n;
  const WrenchAllocation allocation =
      AllocateWrench(kinematics_.StringsAt(pose_), {force, Vec3::Zero()}, bounds, rest_n);
  // A board that does not take the command goes on with the last one at worst; the next Read says
  // so.
  board_->WriteTensions(allocation.tension);
  torque_ = allocation.wrench.torque;
  return allocation.wrench.force;
}

void SpidarGrip::Release() noexcept {
  EightStrings tension;
  tension.fill(settings_.tension_min_n);
  board_->WriteTensions(tension);
  torque_.setZero();
}

std::string SpidarGrip::Complaint() const {
  const std::string of_board = board_->Complaint();
  return of_board.empty() ? wrong_string_.Complaint() : of_board;
}

}  // namespace rikiseki::haptic
