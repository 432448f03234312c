// SPDX-License-Identifier: MIT
// The real USB behind the driver. A thread of its own, with libusb contexts of its own, looks for the
// board, opens and closes it; the tick's thread takes an open one, uses it, and hands it back when it
// is of no use any more. Two pointers are all that they exchange.
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "common/realtime.h"
#include "haptic_server/device/usb/usb_connection.h"
#include "haptic_server/device/usb/usb_settings.h"

namespace rikiseki::haptic {

class LibusbPort final : public UsbPort {
 public:
  /// Looks once before it returns, then goes on looking by itself. Throws nothing: a board that is not
  /// there is a state with a reason. `rest_tension_n` as for UsbBoard.
  LibusbPort(const UsbSettings& usb, double rest_tension_n);

  /// Takes the motors to zero and closes. The tick has ended before.
  ~LibusbPort() override;
  LibusbPort(const LibusbPort&) = delete;
  LibusbPort& operator=(const LibusbPort&) = delete;

  bool Take() noexcept override;
  bool Send(UsbPurpose purpose, std::span<const std::uint8_t> packet) noexcept override;
  std::optional<std::span<const std::uint8_t>> Receive(std::int64_t deadline_ns) noexcept override;
  UsbTrouble trouble() const noexcept override;
  void GiveUp(UsbTrouble why) noexcept override;
  UsbTrouble absence() const noexcept override;
  std::string Complaint() const override;
  std::string Name() const override;

 private:
  void Supervise();
  void Look();
  void Collect();
  void Say(UsbTrouble trouble, const std::string& complaint);

  UsbSettings usb_;  // what is not said there is filled in by the first board
  const double rest_tension_n_;
  bool opened_before_ = false;

  // SYNC: release by the supervisor, acquire by the tick: an open board.
  std::atomic<UsbConnection*> offered_{nullptr};
  // SYNC: release by the tick, acquire by the supervisor: one to be closed.
  std::atomic<UsbConnection*> returned_{nullptr};
  UsbConnection* held_ = nullptr;  // the tick's
  bool is_away_ = false;           // the supervisor's: a board is offered or held
  std::atomic<UsbTrouble> absence_{UsbTrouble::kSearching};
  std::atomic<UsbTrouble> why_returned_{UsbTrouble::kNone};

  mutable std::mutex mutex_;
  std::string complaint_;

  std::atomic<bool> stop_{false};
  std::optional<RealtimeThread> thread_;  // of the ordinary scheduler, with a small stack
};

}  // namespace rikiseki::haptic
