// SPDX-License-Identifier: MIT
#include "haptic_server/device/replay.h"

#include <stdexcept>
#include <utility>

namespace rikiseki::haptic {

Replay::Replay(std::vector<ReplaySample> samples) : samples_(std::move(samples)) {
  if (samples_.empty()) throw std::invalid_argument("the recording holds no tick of a finger");
}

DeviceStatus Replay::Read(std::int64_t now_ns, DeviceSample& sample) noexcept {
  if (!begun_) start_ns_ = now_ns;
  begun_ = true;
  const std::int64_t recorded_ns = samples_.front().time_ns + (now_ns - start_ns_);
  while (newest_ + 1 < samples_.size() && samples_[newest_ + 1].time_ns <= recorded_ns) ++newest_;
  if (newest_ + 1 == samples_.size() && recorded_ns > samples_.back().time_ns) {
    return DeviceStatus::kFault;
  }
  sample = {.position = samples_[newest_].position,
            .velocity = samples_[newest_].velocity,
            .target = samples_[newest_].position,
            .enabled = true};
  return DeviceStatus::kOk;
}

std::string Replay::Complaint() const {
  return "the recording is over";
}

}  // namespace rikiseki::haptic
