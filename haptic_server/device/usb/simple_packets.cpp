// SPDX-License-Identifier: MIT
#include "haptic_server/device/usb/simple_packets.h"

#include <algorithm>

#include "haptic_server/device/usb/little_endian.h"

namespace rikiseki::haptic::simple {
namespace {

constexpr std::size_t kPaddedBytes = 512;
constexpr std::size_t kBytesPerCount = 3;
constexpr std::size_t kParallelPortAt = 24;

}  // namespace

Packet EncodePhase(std::uint8_t mask) noexcept {
  return {0xA2, 0x1A, mask};
}

Packet EncodeClear(std::uint8_t mask) noexcept {
  return {0xA2, 0x19, mask};
}

Packet EncodeDigits(const DaDigits& digits) noexcept {
  Packet packet{0x52};
  for (std::size_t channel = 0; channel < kBoardChannels; ++channel) {
    Store16(packet, 1 + 2 * channel, std::min(digits[channel], kLargestDigit));
  }
  return packet;
}

Packet EncodeLatch() noexcept {
  return {0x51};
}

std::optional<Reply> DecodeReply(std::span<const std::uint8_t> bytes) noexcept {
  if (bytes.size() != kPacketBytes && bytes.size() != kPaddedBytes) return std::nullopt;
  Reply reply;
  for (std::size_t channel = 0; channel < kBoardChannels; ++channel) {
    const std::size_t at = kBytesPerCount * channel;
    const std::uint32_t low = Load16(bytes, at);
    const std::uint32_t high = bytes[at + 2];
    // Shifted to the top and back, so that the sign fills the upper byte.
    reply.counts[channel] = static_cast<std::int32_t>((high << 16 | low) << 8) >> 8;
  }
  reply.parallel_port = bytes[kParallelPortAt];
  return reply;
}

}  // namespace rikiseki::haptic::simple
