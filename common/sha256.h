// SPDX-License-Identifier: MIT
// SHA-256 (FIPS 180-4): what a mesh file is known by.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace rikiseki {

std::array<std::uint8_t, 32> Sha256(std::span<const std::uint8_t> bytes);

}  // namespace rikiseki
