// SPDX-License-Identifier: MIT
// The hands of the tables, the device that they hold included.
#pragma once

#include <array>
#include <optional>

#include "tests/lab/multirate_loop.h"
#include "tests/lab/table.h"

namespace rikiseki::lab {

struct NamedHand {
  const char* name;
  LoopHand impedance;
};

/// numerics section 4; the device's 0.03 kg and 0.2 Ns/m included.
inline const std::array<NamedHand, 6> kHands{{{"finger", haptic::Impedance{0.038, 3.2, 300}},
                                              {"light", haptic::Impedance{0.13, 2.2, 50}},
                                              {"medium", haptic::Impedance{0.58, 6.7, 135}},
                                              {"firm", haptic::Impedance{0.93, 15.2, 500}},
                                              {"stiff", haptic::Impedance{1.53, 30.2, 1000}},
                                              {"clamped", std::nullopt}}};

/// The column `hand`: one of these names, or "m b k" in SI units. Throws ConfigError.
LoopHand ParseHand(const Row& row);

}  // namespace rikiseki::lab
