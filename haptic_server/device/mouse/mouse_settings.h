// SPDX-License-Identifier: MIT
// Section [mouse] of a device file: which SPIDAR-mouse, which ordinary mouse tells where it is, and what
// both mean.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/config.h"
#include "haptic_server/device/usb/usb_settings.h"

namespace rikiseki::haptic {

/// The longest time from one force report to the next in public code, which may be what the board waits.
inline constexpr std::int64_t kLongestReportPeriodNs = 4'000'000;

struct MouseSettings {
  std::string serial = kAnySerial;
  std::string event;                           // of the ordinary mouse: /dev/input/by-id/...
  double count_length_m = 2.54e-5;             // 1000 counts per inch
  std::vector<double> reach_m{0.1, 0.1};       // from the middle to the edges of the space, x and y
  std::vector<double> force_directions{1, 1};  // -1: the board's axis points the other way, x and y
  double min_force_n = 0.3;
  double max_force_n = 1.5;
  double duty_percent_per_n = 47.9867;
  double duty_percent_at_zero = 13.1215;
};

/// Registers the keys of [mouse].
void AddMouseKeys(ConfigSchema& schema, MouseSettings& mouse);

/// What keeps these settings from driving a SPIDAR-mouse; none if nothing does.
std::optional<UsbConflict> FindMouseConflict(const MouseSettings& mouse);

/// The board as the USB driver knows it.
UsbSettings BoardOf(const MouseSettings& mouse);

}  // namespace rikiseki::haptic
