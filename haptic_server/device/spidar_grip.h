// SPDX-License-Identifier: MIT
// An 8-string SPIDAR as a force display, the G6 family: counts -> lengths -> pose of the grip, force
// without a torque -> tensions, over a motor board. Watches that the strings agree with each other.
#pragma once

#include <cstdint>
#include <memory>

#include "haptic_server/device/device.h"
#include "haptic_server/device/motor_board.h"
#include "haptic_server/device/spidar_pose.h"
#include "haptic_server/device/velocity_estimate.h"
#include "haptic_server/device/wrench_tension.h"
#include "haptic_server/device/wrong_string.h"
#include "haptic_server/settings.h"

namespace rikiseki::haptic {

/// The kinematics of the settings. Throws std::invalid_argument unless there are eight motors, each with
/// its attachment, that fix a grip.
SpidarPose GripKinematics(const SpidarSettings& settings);

class SpidarGrip final : public Device {
 public:
  /// As GripKinematics.
  SpidarGrip(const SpidarSettings& settings, std::unique_ptr<MotorBoard> board);

  DeviceStatus Read(std::int64_t now_ns, DeviceSample& sample) noexcept override;

  /// The force about the centre of the grip, with as little torque as the strings can: none wherever
  /// they can hold the grip at all.
  Vec3 Write(const Vec3& force) noexcept override;
  Vec3 torque() const noexcept override { return torque_; }
  void Release() noexcept override;
  void SetVelocityCutoff(double cutoff_hz) noexcept override {
    settings_.velocity_cutoff_hz = cutoff_hz;
  }
  std::string Name() const override { return board_->Name(); }

  /// The board's own, else the string that makes Read a fault.
  std::string Complaint() const override;
  const char* Trouble() const noexcept override { return board_->Trouble(); }

 private:
  SpidarSettings settings_;
  std::unique_ptr<MotorBoard> board_;
  SpidarPose kinematics_;
  EightStrings home_lengths_;
  bool is_sound_ = true;  // the reading before was
  Pose pose_;             // the last sound one
  VelocityEstimate velocity_;
  VelocityEstimate angular_velocity_;
  Vec3 torque_ = Vec3::Zero();  // N m, displayed
  WrongString wrong_string_;
};

}  // namespace rikiseki::haptic
