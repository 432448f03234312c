// SPDX-License-Identifier: MIT
#include "tests/lab/prescribed_device.h"

#include <utility>

#include "common/clock.h"

namespace rikiseki::lab {

PrescribedDevice::PrescribedDevice(Path path, std::int64_t start_ns)
    : path_(std::move(path)), start_ns_(start_ns), read_ns_(start_ns), position_(path_(0)) {}

haptic::DeviceStatus PrescribedDevice::Read(std::int64_t now_ns,
                                            haptic::DeviceSample& sample) noexcept {
  if (now_ns > read_ns_) {
    const Vec3 before = position_;
    position_ = path_(Seconds(now_ns - start_ns_));
    velocity_ = (position_ - before) / Seconds(now_ns - read_ns_);
    read_ns_ = now_ns;
  }
  sample = {.position = position_, .velocity = velocity_, .target = position_};
  return haptic::DeviceStatus::kOk;
}

}  // namespace rikiseki::lab
