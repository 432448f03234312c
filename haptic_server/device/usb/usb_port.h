// SPDX-License-Identifier: MIT
// The pipes of one motor board, as the thread that runs the tick sees them. Behind it stand libusb
// (libusb_port.h) and, in virtual time, the emulated board of tests/usb. A board may vanish and come
// back at any time.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "haptic_server/device/usb/usb_trouble.h"

namespace rikiseki::haptic {

/// What a packet is for. One of each is under way at a time.
enum class UsbPurpose { kRequest, kCommand };

class UsbPort {
 public:
  virtual ~UsbPort() = default;

  /// Takes a board that is ready, if there is one. Then it is the caller's until GiveUp. // RT:
  virtual bool Take() noexcept = 0;

  /// Starts sending a packet of at most 512 bytes. False, and nothing is sent, if the one before of the
  /// same purpose is still under way or there is trouble: the newest is sent at the next occasion,
  /// none ever queues. // RT:
  virtual bool Send(UsbPurpose purpose, std::span<const std::uint8_t> packet) noexcept = 0;

  /// The next answer in the order of the packets, valid until the next call. Waits for it until
  /// `deadline_ns`; none if it did not come by then, or there is trouble. // RT: the tick's only wait
  virtual std::optional<std::span<const std::uint8_t>> Receive(
      std::int64_t deadline_ns) noexcept = 0;

  /// What the bus says of the board that was taken: kNone, or that it is of no use any more. // RT:
  virtual UsbTrouble trouble() const noexcept = 0;

  /// Lets go of the board, because of `why`; it is closed and looked for again elsewhere. // RT:
  virtual void GiveUp(UsbTrouble why) noexcept = 0;

  /// Why there is no board to take; kNone while there is one. From any thread. // RT:
  virtual UsbTrouble absence() const noexcept = 0;

  /// The same in a sentence with the cure, empty if there is nothing to complain of. From any thread.
  virtual std::string Complaint() const = 0;

  virtual std::string Name() const = 0;
};

}  // namespace rikiseki::haptic
