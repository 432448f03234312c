// SPDX-License-Identifier: MIT
// Why a board cannot be had, for people and for the tick.
#pragma once

#include <stdexcept>
#include <string>

#include "haptic_server/device/usb/usb_trouble.h"

namespace rikiseki::haptic {

/// what() is a sentence that names the board and the cure.
class UsbError : public std::runtime_error {
 public:
  UsbError(UsbTrouble trouble, const std::string& what)
      : std::runtime_error(what), trouble_(trouble) {}
  UsbTrouble trouble() const { return trouble_; }

 private:
  UsbTrouble trouble_;
};

}  // namespace rikiseki::haptic
