// SPDX-License-Identifier: MIT
// One open motor board: its transfers, submitted ahead. Opened and closed by the supervisor's thread,
// used between by the tick's alone, which is also the only one that handles the events of its libusb
// context. libusb allocates and locks inside submit and reap; nothing else here does.
#pragma once

#include <libusb.h>
#include <poll.h>

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "haptic_server/device/usb/usb_port.h"
#include "haptic_server/device/usb/usb_settings.h"

namespace rikiseki::haptic {

inline constexpr std::size_t kUsbPacketBytes = 512;

/// The way packets go to a board and answers come back. The Cyverse boards: bulk, EP2 out and EP6 in
/// (Springhead DRCyUsb20Sh4; pipes 1 and 2 of the EZ-USB driver).
struct UsbPipes {
  libusb_transfer_type type = LIBUSB_TRANSFER_TYPE_BULK;
  std::uint8_t out_endpoint = 0x02;
  std::uint8_t in_endpoint = 0x86;
  std::size_t answer_bytes = kUsbPacketBytes;  // the most: a transfer ends where they are full
};

struct LibusbDeleter {
  void operator()(libusb_context* context) const { libusb_exit(context); }
  void operator()(libusb_device_handle* handle) const { libusb_close(handle); }
  void operator()(libusb_transfer* transfer) const { libusb_free_transfer(transfer); }
};
using LibusbContext = std::unique_ptr<libusb_context, LibusbDeleter>;
using LibusbHandle = std::unique_ptr<libusb_device_handle, LibusbDeleter>;

/// A board that answers and whose interface is claimed. The context is its own.
struct OpenBoard {
  LibusbContext context;
  LibusbHandle handle;
  UsbPipes pipes;
  int interface_number = 0;
  int switch_id = kAnySwitch;               // a board that has none
  std::string serial;                       // empty: it has none
  std::string place;                        // "bus 1 device 2"
  std::vector<std::uint8_t> zero_packet{};  // takes all motors to zero

  /// Sends a packet and waits, at most `timeout_ms`. Throws UsbError. Not for the tick.
  void Write(std::span<const std::uint8_t> packet, unsigned timeout_ms);

  /// The next answer, empty if there is none within `timeout_ms`. Throws UsbError. Not for the tick.
  std::vector<std::uint8_t> Read(unsigned timeout_ms);
};

class UsbConnection {
 public:
  /// Submits the transfers that wait for answers. Throws UsbError.
  explicit UsbConnection(OpenBoard board);

  /// Cancels what is under way, takes the motors to zero if the board still listens, and closes.
  /// Takes at most a few tenths of a second.
  ~UsbConnection();
  UsbConnection(const UsbConnection&) = delete;
  UsbConnection& operator=(const UsbConnection&) = delete;

  // As UsbPort has them. // RT:
  bool Send(UsbPurpose purpose, std::span<const std::uint8_t> packet) noexcept;
  std::optional<std::span<const std::uint8_t>> Receive(std::int64_t deadline_ns) noexcept;
  UsbTrouble trouble() const noexcept { return trouble_; }

 private:
  static constexpr std::size_t kInTransfers = 4;
  static constexpr std::size_t kOutTransfers = 2;  // one for each purpose
  static constexpr std::size_t kReplies = 16;      // a power of two

  using Buffer = std::array<std::uint8_t, kUsbPacketBytes>;
  using Transfer = std::unique_ptr<libusb_transfer, LibusbDeleter>;
  struct Reply {
    Buffer bytes;
    std::size_t size = 0;
  };
  // One that libusb has while `is_under_way`.
  struct Slot {
    UsbConnection* owner = nullptr;
    Transfer transfer;
    Buffer buffer{};
    bool is_under_way = false;
  };

  static void LIBUSB_CALL InCompleted(libusb_transfer* transfer) noexcept;
  static void LIBUSB_CALL OutCompleted(libusb_transfer* transfer) noexcept;
  bool Submit(Slot& slot) noexcept;
  void Judge(libusb_transfer_status status) noexcept;
  void HandleEvents() noexcept;
  void Drain(std::int64_t deadline_ns) noexcept;

  OpenBoard board_;
  std::array<Slot, kInTransfers> in_;
  std::array<Slot, kOutTransfers> out_;
  std::vector<pollfd> descriptors_;
  std::array<Reply, kReplies> replies_;
  std::size_t arrived_ = 0;  // of replies, since the beginning
  std::size_t taken_ = 0;
  bool closing_ = false;
  UsbTrouble trouble_ = UsbTrouble::kNone;
};

}  // namespace rikiseki::haptic
