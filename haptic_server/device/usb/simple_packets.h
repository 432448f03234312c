// SPDX-License-Identifier: MIT
// The packets of the Cyverse USB2.0 board "Simple" (0CEC:0203; LDR-SPIDAR-AMP, EZ-USB FX2): bytes to
// and from numbers, nothing else. All facts are from Springhead's and SpringheadOne's DRUsb20Simple
// as noted in public; none was tried on hardware.
//
// Every command is 32 bytes to EP 0x02, of which only the listed ones matter; the rest is sent as 0.
// Only the latch is answered, by 32 bytes from EP 0x86.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "haptic_server/device/usb/board_reading.h"

namespace rikiseki::haptic::simple {

inline constexpr std::uint16_t kProductId = 0x0203;
inline constexpr int kCountBits = 24;
inline constexpr std::size_t kPacketBytes = 32;
using Packet = std::array<std::uint8_t, kPacketBytes>;

/// A2 1A mask: bit n set = channel n counts in the positive direction. Springhead sends FF.
Packet EncodePhase(std::uint8_t mask) noexcept;

/// A2 19 mask: the counters of the channels of the mask become 0.
Packet EncodeClear(std::uint8_t mask) noexcept;

/// 52, then eight D/A digits, little-endian; a larger digit than kLargestDigit is sent as that. // RT:
Packet EncodeDigits(const DaDigits& digits) noexcept;

/// 51: latches the counters and has them sent. // RT:
Packet EncodeLatch() noexcept;

struct Reply {
  RawCounts counts{};  // sign-extended from 24 bits
  std::uint8_t parallel_port = 0;
};

/// The answer to a latch. None unless it has 32 bytes, or 512: whether the firmware pads its answer to
/// a whole USB packet is not known. // RT:
std::optional<Reply> DecodeReply(std::span<const std::uint8_t> bytes) noexcept;

}  // namespace rikiseki::haptic::simple
