// SPDX-License-Identifier: MIT
// A 4-string SPIDAR as a force display: counts -> lengths -> position, force -> tensions, over a
// motor board. Watches that the strings agree with each other: a slack or slipped one is a fault.
#pragma once

#include <cstdint>
#include <memory>

#include "haptic_server/device/device.h"
#include "haptic_server/device/motor_board.h"
#include "haptic_server/device/spidar_kinematics.h"
#include "haptic_server/device/velocity_estimate.h"
#include "haptic_server/device/wrong_string.h"
#include "haptic_server/settings.h"

namespace rikiseki::haptic {

/// Up to here [m] a position is sound: where the string that is found wrong later is judged from.
inline constexpr double kSoundResidual = kSlipResidual / 4;

class Spidar final : public Device {
 public:
  Spidar(const SpidarSettings& settings, std::unique_ptr<MotorBoard> board);

  DeviceStatus Read(std::int64_t now_ns, DeviceSample& sample) noexcept override;
  Vec3 Write(const Vec3& force) noexcept override;
  void Release() noexcept override;
  void SetVelocityCutoff(double cutoff_hz) noexcept override {
    settings_.velocity_cutoff_hz = cutoff_hz;
  }
  std::string Name() const override;

  /// The board's own, else the string that makes Read a fault.
  std::string Complaint() const override;
  const char* Trouble() const noexcept override { return board_->Trouble(); }

 private:
  void Blame(const PerString& lengths) noexcept;

  SpidarSettings settings_;
  std::unique_ptr<MotorBoard> board_;
  SpidarKinematics kinematics_;
  PerString home_lengths_;
  Vec3 position_ = Vec3::Zero();
  VelocityEstimate velocity_;
  bool located_ = false;  // there was a position before
  Vec3 sound_position_ = Vec3::Zero();
  WrongString wrong_string_;
};

}  // namespace rikiseki::haptic
