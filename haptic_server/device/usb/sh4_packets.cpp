// SPDX-License-Identifier: MIT
#include "haptic_server/device/usb/sh4_packets.h"

#include <algorithm>

#include "haptic_server/device/usb/little_endian.h"

namespace rikiseki::haptic::sh4 {
namespace {

constexpr std::size_t kDigitsAt = 2;  // of an update
constexpr std::size_t kEchoAt = 0;    // of a reply, and what follows
constexpr std::size_t kCountsAt = 16;
constexpr std::size_t kAdAt = 32;
constexpr std::size_t kParallelPortAt = 48;
constexpr std::size_t kInfoAt = 50;

}  // namespace

Packet EncodeUpdate(const DaDigits& digits) noexcept {
  Packet packet{0x01, 0x0E};
  for (std::size_t channel = 0; channel < kBoardChannels; ++channel) {
    Store16(packet, kDigitsAt + 2 * channel, std::min(digits[channel], kLargestDigit));
  }
  return packet;
}

std::optional<Reply> DecodeReply(std::span<const std::uint8_t> bytes) noexcept {
  if (bytes.size() != kPacketBytes) return std::nullopt;
  Reply reply;
  for (std::size_t channel = 0; channel < kBoardChannels; ++channel) {
    reply.echo[channel] = Load16(bytes, kEchoAt + 2 * channel);
    reply.counts[channel] = Load16(bytes, kCountsAt + 2 * channel);
    reply.ad[channel] = Load16(bytes, kAdAt + 2 * channel);
  }
  reply.parallel_port = Load16(bytes, kParallelPortAt);
  reply.info = static_cast<std::uint32_t>(Load16(bytes, kInfoAt)) |
               static_cast<std::uint32_t>(Load16(bytes, kInfoAt + 2)) << 16;
  return reply;
}

}  // namespace rikiseki::haptic::sh4
