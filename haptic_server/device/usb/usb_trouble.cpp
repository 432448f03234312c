// SPDX-License-Identifier: MIT
#include "haptic_server/device/usb/usb_trouble.h"

namespace rikiseki::haptic {

const char* InBrief(UsbTrouble trouble) noexcept {
  switch (trouble) {
    case UsbTrouble::kNone:
      return "";
    case UsbTrouble::kSearching:
      return "SPIDAR: looking for the board";
    case UsbTrouble::kUnplugged:
      return "SPIDAR: unplugged";
    case UsbTrouble::kNoFirmware:
      return "SPIDAR: board without firmware";
    case UsbTrouble::kWrongSwitch:
      return "SPIDAR: wrong switch or serial";
    case UsbTrouble::kTwoBoards:
      return "SPIDAR: more than one board";
    case UsbTrouble::kPermission:
      return "SPIDAR: permission denied";
    case UsbTrouble::kBusy:
      return "SPIDAR: used by another program";
    case UsbTrouble::kNoPipes:
      return "SPIDAR: unknown USB interface";
    case UsbTrouble::kWrongFirmware:
      return "SPIDAR: wrong firmware";
    case UsbTrouble::kSilent:
      return "SPIDAR: board does not answer";
    case UsbTrouble::kStalled:
      return "SPIDAR: endpoint stalled";
    case UsbTrouble::kTransferFailed:
      return "SPIDAR: USB transfer failed";
    case UsbTrouble::kShortReply:
      return "SPIDAR: short packets";
    case UsbTrouble::kLateReply:
      return "SPIDAR: late replies";
    case UsbTrouble::kWrongEcho:
      return "SPIDAR: wrong D/A echo";
  }
  return "SPIDAR: unknown trouble";
}

}  // namespace rikiseki::haptic
