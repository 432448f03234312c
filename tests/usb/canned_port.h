// SPDX-License-Identifier: MIT
// A port that answers every request at once and always the same, as far as its board answers: what the driver itself costs, and
// whether it allocates.
#pragma once

#include <array>

#include "haptic_server/device/usb/sh4_packets.h"
#include "haptic_server/device/usb/simple_packets.h"
#include "haptic_server/device/usb/usb_port.h"
#include "haptic_server/device/usb/usb_settings.h"

namespace rikiseki::test {

class CannedPort final : public haptic::UsbPort {
 public:
  explicit CannedPort(haptic::UsbBoardModel model) : model_(model) {}

  bool Take() noexcept override { return true; }

  bool Send(haptic::UsbPurpose, std::span<const std::uint8_t> packet) noexcept override {
    if (model_ == haptic::UsbBoardModel::kSh4) {  // echoes the digits, counts nothing
      std::copy_n(packet.begin() + 2, 16, reply_.begin());
    }
    return !is_silent;
  }

  std::optional<std::span<const std::uint8_t>> Receive(std::int64_t) noexcept override {
    if (is_silent || model_ == haptic::UsbBoardModel::kMouse) return std::nullopt;
    return std::span<const std::uint8_t>(reply_.data(), model_ == haptic::UsbBoardModel::kSh4
                                                            ? haptic::sh4::kPacketBytes
                                                            : haptic::simple::kPacketBytes);
  }

  haptic::UsbTrouble trouble() const noexcept override { return haptic::UsbTrouble::kNone; }
  void GiveUp(haptic::UsbTrouble) noexcept override {}
  haptic::UsbTrouble absence() const noexcept override { return haptic::UsbTrouble::kLateReply; }
  std::string Complaint() const override { return ""; }
  std::string Name() const override { return "canned"; }

  bool is_silent = false;

 private:
  haptic::UsbBoardModel model_;
  std::array<std::uint8_t, haptic::sh4::kPacketBytes> reply_{};
};

}  // namespace rikiseki::test
