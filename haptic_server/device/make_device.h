// SPDX-License-Identifier: MIT
// The SPIDAR of the settings: four motors pull at a point, eight at a grip.
#pragma once

#include <memory>

#include "haptic_server/device/device.h"
#include "haptic_server/device/motor_board.h"
#include "haptic_server/settings.h"

namespace rikiseki::haptic {

/// The SPIDAR that `board` drives. Throws std::invalid_argument if no such one is known.
std::unique_ptr<Device> MakeSpidar(const SpidarSettings& settings,
                                   std::unique_ptr<MotorBoard> board);

/// The simulated one, in the hand of the settings. Throws StartError if it cannot be had.
std::unique_ptr<Device> MakeDevice(const Settings& settings);

}  // namespace rikiseki::haptic
