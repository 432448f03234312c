// SPDX-License-Identifier: MIT
#include "haptic_server/device/usb/usb_settings.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "haptic_server/device/usb/board_reading.h"

namespace rikiseki::haptic {

void AddUsbKeys(ConfigSchema& schema, UsbSettings& usb) {
  schema.Choice("usb.board", &usb.board,
                {{"none", UsbBoardModel::kNone},
                 {"simple", UsbBoardModel::kSimple},
                 {"sh4", UsbBoardModel::kSh4}},
                "The motor board: Cyverse USB2.0 Simple (0CEC:0203) or Sh4 (0CEC:0205).");
  schema.Integer("usb.switch_id", &usb.switch_id, kAnySwitch, 15,
                 "Rotary switch of the board; -1 takes any.");
  schema.Text("usb.serial", &usb.serial, "USB serial number of the board, or any.");
  schema.Numbers("usb.channels", &usb.channels, 0, kBoardChannels - 1,
                 "Channel of the board that each string's motor and encoder is on.");
  schema.Numbers("usb.count_directions", &usb.count_directions, -1, 1,
                 "1, or -1 where an encoder counts the other way than the model's; per string.");
  schema.Numbers("usb.digit_per_volt", &usb.digit_per_volt, 1, 4095,
                 "D/A digits per volt, of all strings or one for each.");
  schema.Numbers("usb.volt_per_newton", &usb.volt_per_newton, 1e-3, 100,
                 "Command voltage per newton of tension, of all strings or one for each.");
  schema.Integer("usb.phase_mask", &usb.phase_mask, 0, 255,
                 "Counting direction of the channels, a bit each; board simple only.");
  schema.Integer(
      "usb.enable_bit", &usb.enable_bit, kNoEnableBit, 15,
      "Bit of the parallel port that reads 1 while the enable input is closed; -1: none.");
  schema.Number("usb.reply_within_us", &usb.reply_within_us, 20, 20'000,
                "How long a tick waits for the encoders.");
}

std::optional<UsbConflict> FindUsbConflict(const UsbSettings& usb, std::size_t string_count,
                                           double tension_max_n, double period_us) {
  if (usb.board == UsbBoardModel::kNone) {
    return UsbConflict{"usb.board",
                       "device.kind = usb needs a device file with a section [usb] that says "
                       "simple or sh4, such as devices/spidar4_simple.ini"};
  }
  const std::string each = std::to_string(string_count) + " numbers, one for each string";
  const auto is_whole = [](double value) { return value == std::round(value); };
  if (usb.channels.size() != string_count ||
      !std::all_of(usb.channels.begin(), usb.channels.end(), is_whole)) {
    return UsbConflict{"usb.channels", each + ", from 0 to 7 are expected"};
  }
  if (std::set<double>(usb.channels.begin(), usb.channels.end()).size() != string_count) {
    return UsbConflict{"usb.channels", "two strings cannot be on one channel"};
  }
  if (usb.count_directions.size() != string_count ||
      !std::all_of(usb.count_directions.begin(), usb.count_directions.end(),
                   [](double value) { return std::abs(value) == 1; })) {
    return UsbConflict{"usb.count_directions", each + ", 1 or -1, are expected"};
  }
  const auto per_string = [&](const std::vector<double>& values, std::size_t string) {
    return values.size() == 1 ? values[0] : values[string];
  };
  for (const auto& [key, values] : {std::pair("usb.digit_per_volt", &usb.digit_per_volt),
                                    std::pair("usb.volt_per_newton", &usb.volt_per_newton)}) {
    if (values->size() != 1 && values->size() != string_count) {
      return UsbConflict{key, "one number, or " + each + ", are expected"};
    }
  }
  for (std::size_t string = 0; string < string_count; ++string) {
    const double digits = tension_max_n * per_string(usb.volt_per_newton, string) *
                          per_string(usb.digit_per_volt, string);
    if (!(std::round(digits) <= kLargestDigit)) {
      return UsbConflict{"usb.volt_per_newton",
                         "with usb.digit_per_volt, spidar.tension_max_n asks string " +
                             std::to_string(string + 1) +
                             " for more than the 4095 digits of the "
                             "D/A: lower spidar.tension_max_n"};
    }
  }
  const bool is_switch = usb.enable_bit >= 4 && usb.enable_bit <= 7;
  if (is_switch || (usb.board == UsbBoardModel::kSimple && usb.enable_bit > 7)) {
    return UsbConflict{
        "usb.enable_bit",
        "bits 4 to 7 are the rotary switch, and the board simple has no more: 0 to 3 "
        "(sh4 also 8 to 15), or -1, is expected"};
  }
  if (!(usb.reply_within_us < period_us)) {
    return UsbConflict{"usb.reply_within_us", "it must be shorter than a period of loop.rate_hz"};
  }
  return std::nullopt;
}

std::string BoardName(UsbBoardModel model) {
  if (model == UsbBoardModel::kMouse) return "SPIDAR-mouse (04D8:003F)";
  return model == UsbBoardModel::kSimple ? "Simple (0CEC:0203)" : "Sh4 (0CEC:0205)";
}

}  // namespace rikiseki::haptic
