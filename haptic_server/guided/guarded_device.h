// SPDX-License-Identifier: MIT
// A force display with the daemon's safety stage before it, for procedures that command forces without a
// world: cap, slew limit, over-speed, soft start and emergency stop are those of the force loop.
#pragma once

#include "haptic_server/device/device.h"
#include "haptic_server/safety/emergency_stop.h"
#include "haptic_server/safety/safety_stage.h"
#include "haptic_server/step.h"

namespace rikiseki::haptic {

class GuardedDevice {
 public:
  /// `device` outlives it.
  GuardedDevice(const Settings& settings, Device& device);

  /// Measures. False if nothing may be concluded from `sample`, or the emergency stop holds: then
  /// Display shows no force, whatever is wanted. // RT:
  bool Read(const TickTime& time, const OperatorInput& wish, DeviceSample& sample) noexcept;

  /// Once after each Read: `wanted` [N, on the user, device axes]; returns what is displayed. // RT:
  Vec3 Display(const Vec3& wanted) noexcept;

  /// Why the force is what it is. kContact and kNoContact: it is what was wanted.
  protocol::ForceReason reason() const noexcept { return safety_.reason(); }

  /// Whether the force is full: the soft start after the beginning, a fault or a stop is over. // RT:
  bool is_full() const noexcept { return full_s_ >= soft_start_s_; }

  void Release() noexcept { device_.Release(); }

 private:
  Device& device_;
  EmergencyStop emergency_stop_;
  SafetyStage safety_;
  SafetyInput input_;
  double period_s_;
  double soft_start_s_;
  double full_s_ = 0;  // without a fault for so long
};

}  // namespace rikiseki::haptic
