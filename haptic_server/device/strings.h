// SPDX-License-Identifier: MIT
// One value for each string of a SPIDAR: what boards, kinematics and tensions have in common.
#pragma once

#include <array>
#include <cstddef>

namespace rikiseki::haptic {

inline constexpr std::size_t kMaxStrings = 8;

/// One value per string, in the order of the device file; beyond the strings that there are: nothing.
using PerString = std::array<double, kMaxStrings>;

/// A string whose length does not fit the others'.
struct SuspectString {
  std::size_t string = 0;
  double excess_m = 0;  // measured too long (it hangs slack or slipped off) or, if < 0, too short
};

}  // namespace rikiseki::haptic
