// SPDX-License-Identifier: MIT
#include "haptic_server/guided/guarded_device.h"

#include <algorithm>

#include "common/clock.h"

namespace rikiseki::haptic {

GuardedDevice::GuardedDevice(const Settings& settings, Device& device)
    : device_(device),
      safety_(settings),
      period_s_(Seconds(settings.period_ns())),
      soft_start_s_(1e-3 * settings.safety.soft_start_ms) {}

bool GuardedDevice::Read(const TickTime& time, const OperatorInput& wish,
                         DeviceSample& sample) noexcept {
  input_ = {};
  input_.device_ok = device_.Read(time.start_ns, sample) == DeviceStatus::kOk;
  input_.sample_finite =
      input_.device_ok && sample.position.allFinite() && sample.velocity.allFinite();
  input_.stopped = emergency_stop_.Update(wish.stop, wish.enable, sample.enabled);
  input_.velocity = input_.sample_finite ? sample.velocity : Vec3(Vec3::Zero());
  input_.speed = input_.velocity.stableNorm();
  input_.peer = protocol::PeerState::kLive;  // the procedure stands for the world
  input_.previous_duration_ns = time.previous_duration_ns;
  input_.missed = time.missed;
  return input_.sample_finite && !input_.stopped;
}

Vec3 GuardedDevice::Display(const Vec3& wanted) noexcept {
  input_.wanted = input_.sample_finite ? wanted : Vec3(Vec3::Zero());
  const Vec3 command = safety_.Limit(input_);
  Vec3 displayed = Vec3::Zero();
  if (input_.stopped) {
    device_.Release();
  } else {
    displayed = device_.Write(command);
  }
  if (!displayed.allFinite()) displayed.setZero();
  safety_.Displayed(displayed);
  const bool faulted = reason() == protocol::ForceReason::kDeviceFault ||
                       reason() == protocol::ForceReason::kNotFinite ||
                       reason() == protocol::ForceReason::kOverSpeed ||
                       reason() == protocol::ForceReason::kLoopFault ||
                       reason() == protocol::ForceReason::kEmergencyStop;
  full_s_ = faulted ? 0 : full_s_ + std::min(period_s_, Seconds(input_.previous_duration_ns));
  return displayed;
}

}  // namespace rikiseki::haptic
