// SPDX-License-Identifier: MIT
// The driver's port with an emulated board behind it, in virtual time: what arrives late, arrives by
// the clock of the ticks.
#pragma once

#include <deque>
#include <optional>
#include <vector>

#include "haptic_server/device/usb/usb_port.h"
#include "tests/usb/emulated_firmware.h"

namespace rikiseki::test {

class EmulatedPort final : public haptic::UsbPort {
 public:
  explicit EmulatedPort(EmulatedFirmware& board) : board_(board) {}

  /// To be set before each tick: the hand's clock.
  std::int64_t now_ns = 0;

  bool plugged = true;
  bool busy = false;                                      // the pipes take nothing
  int late_ticks = 0;                                     // how much later replies arrive
  haptic::UsbTrouble broken = haptic::UsbTrouble::kNone;  // what the bus says

  /// The last reason of GiveUp.
  haptic::UsbTrouble given_up = haptic::UsbTrouble::kNone;
  int times_given_up = 0;
  int sent = 0;

  /// A tick is over: what is late comes nearer.
  void NextTick() {
    for (Late& reply : replies_) --reply.ticks;
    board_.FirmwareTick();
  }

  bool Take() noexcept override {
    if (plugged) {
      replies_.clear();
      broken = haptic::UsbTrouble::kNone;
    }
    return plugged;
  }

  bool Send(haptic::UsbPurpose, std::span<const std::uint8_t> packet) noexcept override {
    if (!plugged || busy || broken != haptic::UsbTrouble::kNone) return false;
    ++sent;
    if (auto reply = board_.Handle(packet, now_ns)) {
      replies_.push_back({late_ticks, std::move(*reply)});
    }
    return true;
  }

  std::optional<std::span<const std::uint8_t>> Receive(std::int64_t) noexcept override {
    if (trouble() != haptic::UsbTrouble::kNone || replies_.empty() || replies_.front().ticks > 0) {
      return std::nullopt;
    }
    received_ = std::move(replies_.front().bytes);
    replies_.pop_front();
    return received_;
  }

  haptic::UsbTrouble trouble() const noexcept override {
    return plugged ? broken : haptic::UsbTrouble::kUnplugged;
  }
  void GiveUp(haptic::UsbTrouble why) noexcept override {
    given_up = why;
    ++times_given_up;
  }
  haptic::UsbTrouble absence() const noexcept override { return given_up; }
  std::string Complaint() const override { return InBrief(given_up); }
  std::string Name() const override { return "emulated SPIDAR"; }

 private:
  struct Late {
    int ticks = 0;
    std::vector<std::uint8_t> bytes;
  };
  EmulatedFirmware& board_;
  std::deque<Late> replies_;
  std::vector<std::uint8_t> received_;
};

}  // namespace rikiseki::test
