// SPDX-License-Identifier: MIT
#include "haptic_server/device/mouse/mouse_packets.h"

#include <bit>

namespace rikiseki::haptic::mouse {
namespace {

enum Command : std::uint8_t { kStart = 80, kRequestState = 82, kForce = 97, kStop = 99 };

void Store(Report& report, std::size_t offset, float value) noexcept {
  const auto bits = std::bit_cast<std::uint32_t>(value);
  for (std::size_t byte = 0; byte < sizeof bits; ++byte) {
    report[offset + byte] = static_cast<std::uint8_t>(bits >> (8 * byte));
  }
}

}  // namespace

Report EncodeStateRequest() noexcept {
  return {kRequestState};
}

Report EncodeStart(const ForceRange& range) noexcept {
  Report report{kStart};
  Store(report, 1, range.min_n);
  Store(report, 5, range.max_n);
  Store(report, 9, range.duty_percent_per_n);
  Store(report, 13, range.duty_percent_at_zero);
  return report;
}

Report EncodeForce(const PlaneForce& force) noexcept {
  Report report{kForce};
  Store(report, 9, force.magnitude_n);
  Store(report, 13, force.direction_x);
  Store(report, 17, force.direction_y);
  return report;
}

Report EncodeStop() noexcept {
  return {kStop};
}

}  // namespace rikiseki::haptic::mouse
