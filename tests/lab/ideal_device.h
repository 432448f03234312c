// SPDX-License-Identifier: MIT
// A force display without strings, motors or encoders: the finger is where the hand is, exactly,
// and feels the commanded force, exactly, held from tick to tick.
#pragma once

#include <cstdint>
#include <string>

#include "haptic_server/device/device.h"
#include "haptic_server/device/hand.h"

namespace rikiseki::lab {

class IdealDevice final : public haptic::Device {
 public:
  /// The hand's time 0 is `start_ns`; before that it rests where it is.
  IdealDevice(haptic::Hand hand, std::int64_t start_ns);

  haptic::DeviceStatus Read(std::int64_t now_ns, haptic::DeviceSample& sample) noexcept override;
  Vec3 Write(const Vec3& force) noexcept override;
  void Release() noexcept override { force_.setZero(); }
  std::string Name() const override { return "ideal device"; }

 private:
  haptic::Hand hand_;
  std::int64_t start_ns_;
  Vec3 force_ = Vec3::Zero();     // N, on the hand
  Vec3 velocity_ = Vec3::Zero();  // m/s, mean since the sample before
};

}  // namespace rikiseki::lab
