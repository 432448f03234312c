// SPDX-License-Identifier: MIT
// The packets of the Cyverse USB2.0 board "Sh4" (0CEC:0205; SH-4 and FX2): bytes to and from numbers,
// nothing else. The facts are from Springhead's DRUsb20Sh4 and DRCyUsb20Sh4 as noted in public; none
// was tried on hardware. Only the base protocol, "update all data", is spoken.
//
// One exchange is 512 bytes to EP 0x02 and 512 bytes back from EP 0x86. A board may carry other
// firmware (IHC variants), which is known by its echo: the answer must begin with the D/A settings.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "haptic_server/device/usb/board_reading.h"

namespace rikiseki::haptic::sh4 {

inline constexpr std::uint16_t kProductId = 0x0205;
inline constexpr int kCountBits = 16;
inline constexpr std::size_t kPacketBytes = 512;
using Packet = std::array<std::uint8_t, kPacketBytes>;

/// Volts at the motor per digit of an A/D reading: 24 V over 12 bits.
inline constexpr double kVoltPerAdDigit = 24.0 / 4096;

/// 01 0E, then eight D/A digits, little-endian; a larger digit than kLargestDigit is sent as that.
/// // RT:
Packet EncodeUpdate(const DaDigits& digits) noexcept;

struct Reply {
  DaDigits echo{};
  RawCounts counts{};                              // 0..65535
  std::array<std::uint16_t, kBoardChannels> ad{};  // motor voltage, kVoltPerAdDigit
  std::uint16_t parallel_port = 0;
  std::uint32_t info = 0;  // its meaning is not known
};

/// The answer to an update; none unless it has all 512 bytes. // RT:
std::optional<Reply> DecodeReply(std::span<const std::uint8_t> bytes) noexcept;

}  // namespace rikiseki::haptic::sh4
