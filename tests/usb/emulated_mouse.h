// SPDX-License-Identifier: MIT
// The firmware of a SPIDAR-mouse that is not there, byte by byte. It reads reports by the published table
// on its own: nothing of the driver's packet code is used. What it answers to a request for its state is
// made up, for nothing is published about it.
#pragma once

#include <array>

#include "tests/usb/emulated_firmware.h"

namespace rikiseki::test {

class EmulatedMouse final : public EmulatedFirmware {
 public:
  std::optional<std::vector<std::uint8_t>> Handle(std::span<const std::uint8_t> packet,
                                                  std::int64_t now_ns) override;
  void FirmwareTick() override {}

  /// Between a start and the next stop.
  bool is_started() const { return is_started_; }

  /// What the start said: smallest and largest force, slope and offset of the duty cycle.
  const std::array<float, 4>& range() const { return range_; }

  /// What it pulls with, N, in its own axes: nothing while it is stopped.
  std::array<double, 2> force() const;
  double magnitude() const { return is_started_ ? magnitude_ : 0; }

  int starts() const { return starts_; }
  int forces() const { return forces_; }
  int stops() const { return stops_; }
  int nonsense() const { return nonsense_; }  // reports that mean nothing, or forces out of range

 private:
  bool is_started_ = false;
  std::array<float, 4> range_{};
  float magnitude_ = 0;
  std::array<float, 2> direction_{};
  int starts_ = 0;
  int forces_ = 0;
  int stops_ = 0;
  int nonsense_ = 0;
};

}  // namespace rikiseki::test
