// SPDX-License-Identifier: MIT
// A force display in a hand of infinite impedance: the finger follows its path whatever it feels.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "haptic_server/device/device.h"

namespace rikiseki::lab {

class PrescribedDevice final : public haptic::Device {
 public:
  using Path = std::function<Vec3(double t_s)>;

  /// The path's time 0 is `start_ns`; before that the finger rests at its beginning.
  PrescribedDevice(Path path, std::int64_t start_ns);

  haptic::DeviceStatus Read(std::int64_t now_ns, haptic::DeviceSample& sample) noexcept override;
  Vec3 Write(const Vec3& force) noexcept override { return force; }
  void Release() noexcept override {}
  std::string Name() const override { return "prescribed path"; }

 private:
  Path path_;
  std::int64_t start_ns_;
  std::int64_t read_ns_;          // of the sample before
  Vec3 position_;                 // m, then
  Vec3 velocity_ = Vec3::Zero();  // m/s, mean since the sample before that
};

}  // namespace rikiseki::lab
