// SPDX-License-Identifier: MIT
// A force display without faults of its own: the finger is where the test puts it, every force is
// displayed as commanded. It can be told to fail.
#pragma once

#include <cmath>
#include <functional>
#include <string>

#include "haptic_server/device/device.h"

namespace rikiseki::haptic {

class TestDevice final : public Device {
 public:
  DeviceStatus Read(std::int64_t, DeviceSample& sample) noexcept override {
    sample = next;
    return status;
  }
  Vec3 Write(const Vec3& command) noexcept override {
    force = command;
    return force;
  }
  void Release() noexcept override {
    force.setZero();
    released = true;
  }
  std::string Name() const override { return "test device"; }

  DeviceSample next;
  DeviceStatus status = DeviceStatus::kOk;
  Vec3 force = Vec3::Zero();
  bool released = false;
};

}  // namespace rikiseki::haptic
