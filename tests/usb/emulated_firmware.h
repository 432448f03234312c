// SPDX-License-Identifier: MIT
// What stands behind an emulated bus or port: packets in, answers out.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace rikiseki::test {

class EmulatedFirmware {
 public:
  virtual ~EmulatedFirmware() = default;

  /// One packet from the host, when the clock of whoever holds the device shows `now_ns`. The answer, if
  /// there is one.
  virtual std::optional<std::vector<std::uint8_t>> Handle(std::span<const std::uint8_t> packet,
                                                          std::int64_t now_ns) = 0;

  /// A tick of the firmware's own.
  virtual void FirmwareTick() = 0;
};

}  // namespace rikiseki::test
