// SPDX-License-Identifier: MIT
// Section [usb] of a device file: which board, which of its channels drives which string, and what its
// digits mean.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "common/config.h"

namespace rikiseki::haptic {

enum class UsbBoardModel {
  kNone,
  kSimple,
  kSh4,
  kMouse  // chosen by device.kind, not by usb.board
};

inline constexpr int kAnySwitch = -1;
inline constexpr int kNoEnableBit = -1;
inline constexpr const char* kAnySerial = "any";

struct UsbSettings {
  UsbBoardModel board = UsbBoardModel::kNone;
  int switch_id = kAnySwitch;  // rotary switch of the board, 0..15
  std::string serial = kAnySerial;
  std::vector<double> channels{0, 1, 2, 3};             // of each string
  std::vector<double> count_directions{1, 1, 1, 1};     // -1: flipped, of each string
  std::vector<double> digit_per_volt{415};              // of all, or of each string
  std::vector<double> volt_per_newton{0.365296803653};  // likewise
  int phase_mask = 0xFF;                                // Simple only
  int enable_bit = kNoEnableBit;                        // of the parallel port; 1 = closed
  double reply_within_us = 500;
};

/// Registers the keys of [usb].
void AddUsbKeys(ConfigSchema& schema, UsbSettings& usb);

struct UsbConflict {
  std::string key;
  std::string why;
};

/// What keeps these settings from driving `string_count` strings of at most `tension_max_n` [N] at a
/// period of `period_us`; none if nothing does.
std::optional<UsbConflict> FindUsbConflict(const UsbSettings& usb, std::size_t string_count,
                                           double tension_max_n, double period_us);

/// "Simple (0CEC:0203)", "Sh4 (0CEC:0205)", "SPIDAR-mouse (04D8:003F)".
std::string BoardName(UsbBoardModel model);

}  // namespace rikiseki::haptic
