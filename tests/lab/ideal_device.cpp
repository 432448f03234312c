// SPDX-License-Identifier: MIT
#include "tests/lab/ideal_device.h"

#include <utility>

#include "common/clock.h"

namespace rikiseki::lab {

IdealDevice::IdealDevice(haptic::Hand hand, std::int64_t start_ns)
    : hand_(std::move(hand)), start_ns_(start_ns) {}

haptic::DeviceStatus IdealDevice::Read(std::int64_t now_ns, haptic::DeviceSample& sample) noexcept {
  const std::int64_t dt_ns = now_ns - start_ns_ - hand_.now_ns();
  if (dt_ns > 0) {
    const Vec3 before = hand_.position();
    hand_.Advance(dt_ns, force_);
    velocity_ = (hand_.position() - before) / Seconds(dt_ns);
  }
  sample = {.position = hand_.position(), .velocity = velocity_, .target = hand_.target()};
  return haptic::DeviceStatus::kOk;
}

Vec3 IdealDevice::Write(const Vec3& force) noexcept {
  force_ = force;
  return force;
}

}  // namespace rikiseki::lab
