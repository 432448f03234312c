// SPDX-License-Identifier: MIT
// What the packets of the Cyverse boards have in common: eight motors, eight counters, one port.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace rikiseki::haptic {

inline constexpr std::size_t kBoardChannels = 8;

/// D/A settings: "unsigned digit = volts x 415" (Springhead DRUsb20Simple, DRUsb20Sh4).
using DaDigits = std::array<std::uint16_t, kBoardChannels>;

/// The width of the D/A: inferred from "12 bit full scale" (4095 is 27 N), stated nowhere. No packet
/// carries more.
inline constexpr std::uint16_t kLargestDigit = 4095;

/// Encoder counters as the board gives them: `bits` wide, two's complement, wrapping.
using RawCounts = std::array<std::int32_t, kBoardChannels>;

/// The rotary switch of the board is read from bits 4..7 of its parallel port, bit 4 the lowest
/// (Springhead ReadRotarySwitch, both boards).
constexpr int SwitchId(std::uint16_t parallel_port) noexcept {
  return parallel_port >> 4 & 0xF;
}

/// The counter value nearest to `previous` of which only the lowest `bits` are known: right as long as
/// a string moves less than half the range between two readings. // RT:
constexpr std::int64_t ExtendCount(std::int64_t previous, std::int32_t raw, int bits) noexcept {
  const std::uint64_t range = std::uint64_t{1} << bits;
  const std::uint64_t step =
      (static_cast<std::uint64_t>(std::int64_t{raw}) - static_cast<std::uint64_t>(previous)) &
      (range - 1);
  const auto signed_step = static_cast<std::int64_t>(step);
  return previous +
         (step >= range / 2 ? signed_step - static_cast<std::int64_t>(range) : signed_step);
}

}  // namespace rikiseki::haptic
