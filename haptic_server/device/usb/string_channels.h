// SPDX-License-Identifier: MIT
// Which channel of a board pulls and counts which string: tensions to D/A digits, counters to counts.
#pragma once

#include "haptic_server/device/motor_board.h"
#include "haptic_server/device/usb/board_reading.h"
#include "haptic_server/device/usb/usb_settings.h"

namespace rikiseki::haptic {

class StringChannels {
 public:
  /// Settings in which FindUsbConflict finds nothing; as many strings as usb.channels.
  explicit StringChannels(const UsbSettings& usb);

  /// The digits of tensions [N]: digit = tension x V/N x digit/V, to the nearest. What is not a positive
  /// number is 0, as are channels without a string. // RT:
  DaDigits Digits(const PerString& tension) const noexcept;

  std::size_t string_count() const noexcept { return string_count_; }

  /// The board's counter of a string. // RT:
  std::int32_t Raw(const RawCounts& counts, std::size_t string) const noexcept {
    return counts[channel_[string]];
  }

  /// +1 if the counter grows with the length of the string, else -1. The host of the Sh4 negates its
  /// counts, that of the Simple does not (Springhead). // RT:
  int direction(std::size_t string) const noexcept { return direction_[string]; }

 private:
  std::size_t string_count_;
  std::array<std::size_t, kMaxStrings> channel_{};
  std::array<int, kMaxStrings> direction_{};
  PerString digit_per_newton_{};
};

}  // namespace rikiseki::haptic
