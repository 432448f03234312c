// SPDX-License-Identifier: MIT
// A recording as a device: the finger goes where it went, whatever the force. For looking again at what
// happened, with other settings, another world or another build.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "haptic_server/device/device.h"

namespace rikiseki::haptic {

/// One recorded tick, in device axes.
struct ReplaySample {
  std::int64_t time_ns = 0;  // on any clock; they do not go back
  Vec3 position = Vec3::Zero();
  Vec3 velocity = Vec3::Zero();
};

/// Begins with the first Read. Between two samples the earlier one holds; after the last, the device is
/// at fault: there is no more to say. Displays every force as commanded: nobody is there to feel it.
class Replay final : public Device {
 public:
  /// Throws std::invalid_argument if there are no samples.
  explicit Replay(std::vector<ReplaySample> samples);

  DeviceStatus Read(std::int64_t now_ns, DeviceSample& sample) noexcept override;
  Vec3 Write(const Vec3& force) noexcept override { return force; }
  void Release() noexcept override {}
  std::string Name() const override { return "recording"; }
  std::string Complaint() const override;

 private:
  std::vector<ReplaySample> samples_;
  std::size_t newest_ = 0;
  std::int64_t start_ns_ = 0;  // of the first Read
  bool begun_ = false;
};

}  // namespace rikiseki::haptic
