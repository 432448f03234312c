// SPDX-License-Identifier: MIT
// What the prompts of guided procedures ask for, at the simulated device.
#pragma once

#include "haptic_server/device/hand.h"
#include "haptic_server/settings.h"

namespace rikiseki::haptic {

/// Nobody's: the grip alone, in the middle. Throws std::invalid_argument if it has no mass.
Hand AbsentHand(const Settings& settings);

/// Holds the grip in the middle for two seconds, then leads it through the inner half of the space.
Hand LeadingHand(const Settings& settings);

}  // namespace rikiseki::haptic
