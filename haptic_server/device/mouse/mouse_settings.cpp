// SPDX-License-Identifier: MIT
#include "haptic_server/device/mouse/mouse_settings.h"

#include <algorithm>
#include <cmath>

namespace rikiseki::haptic {

void AddMouseKeys(ConfigSchema& schema, MouseSettings& mouse) {
  schema.Text("mouse.serial", &mouse.serial, "USB serial number of the SPIDAR-mouse, or any.");
  schema.Text("mouse.event", &mouse.event,
              "Event device of the ordinary mouse that tells where the hand is.");
  schema.Number("mouse.count_length_m", &mouse.count_length_m, 1e-7, 1e-3,
                "Way on the desk per count of the ordinary mouse.");
  schema.Numbers("mouse.reach_m", &mouse.reach_m, 1e-3, 1,
                 "From the middle to the edges of the space, x and y.");
  schema.Numbers("mouse.force_directions", &mouse.force_directions, -1, 1,
                 "1, or -1 where the board pulls the other way, x and y.");
  schema.Number("mouse.min_force_n", &mouse.min_force_n, 0.01, 10,
                "Less the board cannot show: nothing is shown instead.");
  schema.Number("mouse.max_force_n", &mouse.max_force_n, 0.02, 10, "More the board cannot show.");
  schema.Number("mouse.duty_percent_per_n", &mouse.duty_percent_per_n, 0, 1000,
                "Duty cycle of the board's motors per newton.");
  schema.Number("mouse.duty_percent_at_zero", &mouse.duty_percent_at_zero, 0, 100,
                "Duty cycle to which that is added.");
}

std::optional<UsbConflict> FindMouseConflict(const MouseSettings& mouse) {
  if (mouse.event.empty()) {
    return UsbConflict{"mouse.event",
                       "a SPIDAR-mouse does not tell where it is: the event device of an ordinary "
                       "mouse is expected, such as /dev/input/by-id/usb-Maker_Mouse-event-mouse"};
  }
  if (mouse.reach_m.size() != 2) {
    return UsbConflict{"mouse.reach_m", "2 numbers, of x and y, are expected"};
  }
  if (mouse.force_directions.size() != 2 ||
      !std::all_of(mouse.force_directions.begin(), mouse.force_directions.end(),
                   [](double value) { return std::abs(value) == 1; })) {
    return UsbConflict{"mouse.force_directions", "2 numbers, 1 or -1, are expected"};
  }
  if (!(mouse.min_force_n < mouse.max_force_n)) {
    return UsbConflict{"mouse.max_force_n", "it must exceed mouse.min_force_n"};
  }
  return std::nullopt;
}

UsbSettings BoardOf(const MouseSettings& mouse) {
  UsbSettings usb;
  usb.board = UsbBoardModel::kMouse;
  usb.serial = mouse.serial;
  return usb;
}

}  // namespace rikiseki::haptic
