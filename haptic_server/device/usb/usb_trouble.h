// SPDX-License-Identifier: MIT
// What can be wrong with a board on the USB, in words.
#pragma once

#include <cstdint>

namespace rikiseki::haptic {

enum class UsbTrouble : std::uint8_t {
  kNone,
  kSearching,       // not looked for yet
  kUnplugged,       // no such board on the bus
  kNoFirmware,      // none, but an EZ-USB chip that was never programmed
  kWrongSwitch,     // boards, but none with the wanted switch or serial number
  kTwoBoards,       // more than one fits
  kPermission,      // the device node may not be opened
  kBusy,            // another program has it
  kNoPipes,         // the interface is not the one that is known
  kWrongFirmware,   // it answers, but not as the known firmware does
  kSilent,          // it does not answer at all
  kStalled,         // an endpoint refused
  kTransferFailed,  // another error of the bus
  kShortReply,
  kLateReply,
  kWrongEcho,
};

/// A few words, at most 31 characters: what haptic_status shows for the device. // RT:
const char* InBrief(UsbTrouble trouble) noexcept;

}  // namespace rikiseki::haptic
