// SPDX-License-Identifier: MIT
// The byte order of the Cyverse boards.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace rikiseki::haptic {

/// The two bytes at `offset`, which must lie inside. // RT:
inline std::uint16_t Load16(std::span<const std::uint8_t> bytes, std::size_t offset) noexcept {
  return static_cast<std::uint16_t>(bytes[offset] | bytes[offset + 1] << 8);
}

/// Likewise. // RT:
inline void Store16(std::span<std::uint8_t> bytes, std::size_t offset,
                    std::uint16_t value) noexcept {
  bytes[offset] = static_cast<std::uint8_t>(value);
  bytes[offset + 1] = static_cast<std::uint8_t>(value >> 8);
}

}  // namespace rikiseki::haptic
