// SPDX-License-Identifier: MIT
// The device of the settings where it may be a real one.
#pragma once

#include <memory>
#include <string>

#include "haptic_server/device/device.h"
#include "haptic_server/device/motor_board.h"
#include "haptic_server/settings.h"

namespace rikiseki::haptic {

/// As MakeDevice, and the SPIDARs on the USB as well: whether they are plugged in or not. Throws StartError.
std::unique_ptr<Device> OpenDevice(const Settings& settings);

/// The board alone, likewise.
std::unique_ptr<MotorBoard> OpenUsbBoard(const Settings& settings);

/// For --check: a sentence on the board that would be used, or on why there is none. Opens and closes it;
/// the motors are left at zero. Empty for a simulated device.
std::string DescribeBoard(const Settings& settings);

}  // namespace rikiseki::haptic
