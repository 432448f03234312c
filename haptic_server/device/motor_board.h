// SPDX-License-Identifier: MIT
// The electronics of a SPIDAR: motors that pull with a commanded tension and encoders that count
// string. Behind it stand the simulated board and, with the USB drivers, the real ones.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "haptic_server/device/strings.h"

namespace rikiseki::haptic {

class Hand;

/// Encoder counts, longer strings count up; all are 0 with the grip in the origin of the device.
/// Beyond the strings that there are: nothing.
using EncoderCounts = std::array<std::int64_t, kMaxStrings>;

class MotorBoard {
 public:
  virtual ~MotorBoard() = default;

  /// Latches and reads the encoders. False if the board does not answer. // RT:
  virtual bool ReadCounts(std::int64_t now_ns, EncoderCounts& counts) noexcept = 0;

  /// Pulls with `tension` [N] from now on. False if the board does not answer. // RT:
  virtual bool WriteTensions(const PerString& tension) noexcept = 0;

  /// Whether the enable input was closed at the last ReadCounts; true on a board that has none. //
  /// RT:
  virtual bool Enabled() const noexcept = 0;

  /// The simulated hand that holds the grip; null where it is a real one.
  virtual const Hand* hand() const noexcept = 0;

  virtual std::string Name() const = 0;

  /// What keeps the board from answering, in a few words; empty: nothing is known. // RT:
  virtual const char* Trouble() const noexcept { return ""; }

  /// The same in a sentence with the cure. From any thread.
  virtual std::string Complaint() const { return ""; }
};

}  // namespace rikiseki::haptic
