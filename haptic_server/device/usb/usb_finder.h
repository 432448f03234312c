// SPDX-License-Identifier: MIT
// Finds the one board on the bus that the settings mean, opens it, and knows it by how it answers.
// Takes its time: not for the tick.
#pragma once

#include "haptic_server/device/usb/usb_connection.h"
#include "haptic_server/device/usb/usb_settings.h"

namespace rikiseki::haptic {

/// Opens the board: permission, interface, switch ID or serial number and firmware are checked. Throws
/// UsbError, whose text says what is wrong and what helps.
OpenBoard FindBoard(const UsbSettings& usb);

/// Makes a board that was found ready for the tick: counting direction (Simple), minimum tension. The
/// `first` time also takes up the slack, at minimum tension for 0.1 s, and clears the counters where
/// the command exists (Simple): the sequence of SpringheadOne's LVRM. Throws UsbError.
void SetUpBoard(OpenBoard& board, const UsbSettings& usb, double rest_tension_n, bool first);

}  // namespace rikiseki::haptic
