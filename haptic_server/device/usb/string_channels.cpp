// SPDX-License-Identifier: MIT
#include "haptic_server/device/usb/string_channels.h"

#include <algorithm>
#include <cmath>

namespace rikiseki::haptic {
namespace {

double OfString(const std::vector<double>& values, std::size_t string) {
  return values.size() == 1 ? values[0] : values.at(string);
}

}  // namespace

StringChannels::StringChannels(const UsbSettings& usb) : string_count_(usb.channels.size()) {
  const int of_board = usb.board == UsbBoardModel::kSh4 ? -1 : 1;
  for (std::size_t string = 0; string < string_count_; ++string) {
    channel_.at(string) = static_cast<std::size_t>(usb.channels.at(string));
    direction_[string] = usb.count_directions.at(string) < 0 ? -of_board : of_board;
    digit_per_newton_[string] =
        OfString(usb.volt_per_newton, string) * OfString(usb.digit_per_volt, string);
  }
}

DaDigits StringChannels::Digits(const PerString& tension) const noexcept {
  DaDigits digits{};
  for (std::size_t string = 0; string < string_count_; ++string) {
    const double wanted = tension[string] * digit_per_newton_[string];
    if (!(wanted > 0)) continue;
    digits[channel_[string]] =
        static_cast<std::uint16_t>(std::round(std::min<double>(wanted, kLargestDigit)));
  }
  return digits;
}

}  // namespace rikiseki::haptic
