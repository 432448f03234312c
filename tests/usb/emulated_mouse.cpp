// SPDX-License-Identifier: MIT
#include "tests/usb/emulated_mouse.h"

#include <bit>
#include <cmath>

namespace rikiseki::test {
namespace {

float Number(std::span<const std::uint8_t> bytes, std::size_t at) {
  return std::bit_cast<float>(static_cast<std::uint32_t>(
      bytes[at] + 256 * (bytes[at + 1] + 256 * (bytes[at + 2] + 256L * bytes[at + 3]))));
}

}  // namespace

std::optional<std::vector<std::uint8_t>> EmulatedMouse::Handle(std::span<const std::uint8_t> packet,
                                                               std::int64_t) {
  if (packet.size() != 64) {
    ++nonsense_;
    return std::nullopt;
  }
  switch (packet[0]) {
    case 82:
      return std::vector<std::uint8_t>(64, 0x52);
    case 80:
      for (std::size_t i = 0; i < range_.size(); ++i) range_[i] = Number(packet, 1 + 4 * i);
      is_started_ = true;
      ++starts_;
      break;
    case 97: {
      magnitude_ = Number(packet, 9);
      direction_ = {Number(packet, 13), Number(packet, 17)};
      const float length = std::hypot(direction_[0], direction_[1]);
      const bool is_shown =
          magnitude_ >= range_[0] && magnitude_ <= range_[1] && std::abs(length - 1) < 1e-6F;
      const bool is_none = magnitude_ == 0;
      if (!is_started_ || !(is_shown || is_none) || Number(packet, 1) != 0 ||
          Number(packet, 5) != 0) {
        ++nonsense_;
      }
      ++forces_;
      break;
    }
    case 99:
      is_started_ = false;
      ++stops_;
      break;
    default:
      ++nonsense_;
  }
  return std::nullopt;
}

std::array<double, 2> EmulatedMouse::force() const {
  return {magnitude() * double{direction_[0]}, magnitude() * double{direction_[1]}};
}

}  // namespace rikiseki::test
