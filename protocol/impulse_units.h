// SPDX-License-Identifier: MIT
// Sums of impulse units as SPEC.md 7.1 defines them: modulo 2^64, which is defined, unlike the
// overflow of signed numbers.
#pragma once

#include <cstddef>
#include <cstdint>

#include "protocol/messages.h"

namespace rikiseki::protocol {

constexpr ImpulseUnits Plus(const ImpulseUnits& a, const ImpulseUnits& b) noexcept {
  ImpulseUnits sum{};
  for (std::size_t i = 0; i < sum.size(); ++i) {
    sum[i] = static_cast<std::int64_t>(static_cast<std::uint64_t>(a[i]) +
                                       static_cast<std::uint64_t>(b[i]));
  }
  return sum;
}

constexpr ImpulseUnits Minus(const ImpulseUnits& a, const ImpulseUnits& b) noexcept {
  ImpulseUnits difference{};
  for (std::size_t i = 0; i < difference.size(); ++i) {
    difference[i] = static_cast<std::int64_t>(static_cast<std::uint64_t>(a[i]) -
                                              static_cast<std::uint64_t>(b[i]));
  }
  return difference;
}

/// In N s, or N m s of an angular one.
constexpr Vector InSi(const ImpulseUnits& units) noexcept {
  return {static_cast<double>(units[0]) * kImpulseUnit,
          static_cast<double>(units[1]) * kImpulseUnit,
          static_cast<double>(units[2]) * kImpulseUnit};
}

}  // namespace rikiseki::protocol
