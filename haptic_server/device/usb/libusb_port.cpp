// SPDX-License-Identifier: MIT
#include "haptic_server/device/usb/libusb_port.h"

#include <sys/time.h>

#include <exception>

#include "common/clock.h"
#include "haptic_server/device/usb/usb_error.h"
#include "haptic_server/device/usb/usb_finder.h"

namespace rikiseki::haptic {
namespace {

constexpr std::int64_t kRetryNs = 250'000'000;
constexpr int kPollUs = 20'000;
constexpr std::size_t kStackBytes = 256 * 1024;

// Hears of boards that come, so that one is not looked for in vain at full length.
class Arrivals {
 public:
  Arrivals() {
    libusb_context* context = nullptr;
    if (libusb_init(&context) != 0) return;
    context_.reset(context);
    libusb_hotplug_register_callback(context, LIBUSB_HOTPLUG_EVENT_DEVICE_ARRIVED, 0,
                                     LIBUSB_HOTPLUG_MATCH_ANY, LIBUSB_HOTPLUG_MATCH_ANY,
                                     LIBUSB_HOTPLUG_MATCH_ANY, Arrived, this, nullptr);
  }

  // Whether something arrived within `kPollUs`.
  bool Wait() {
    if (context_ == nullptr) {
      SleepUntil(MonotonicNow() + kPollUs * 1'000);
      return false;
    }
    arrived_ = false;
    timeval patience{.tv_sec = 0, .tv_usec = kPollUs};
    libusb_handle_events_timeout_completed(context_.get(), &patience, nullptr);
    return arrived_;
  }

 private:
  static int LIBUSB_CALL Arrived(libusb_context*, libusb_device*, libusb_hotplug_event,
                                 void* self) {
    static_cast<Arrivals*>(self)->arrived_ = true;
    return 0;
  }

  LibusbContext context_;
  bool arrived_ = false;
};

std::string WhyReturned(UsbTrouble trouble) {
  switch (trouble) {
    case UsbTrouble::kUnplugged:
      return "the board was unplugged";
    case UsbTrouble::kStalled:
      return "an endpoint of the board stalled; it is opened anew";
    case UsbTrouble::kShortReply:
      return "the board's answers have the wrong length; it is opened anew";
    case UsbTrouble::kLateReply:
      return "the board's answers came late or not at all; it is opened anew";
    case UsbTrouble::kWrongEcho:
      return "the board did not echo its D/A settings; it is opened anew";
    default:
      return "a USB transfer failed; the board is opened anew";
  }
}

}  // namespace

LibusbPort::LibusbPort(const UsbSettings& usb, double rest_tension_n)
    : usb_(usb), rest_tension_n_(rest_tension_n) {
  Look();
  thread_.emplace(RealtimeRequest{.stack_bytes = kStackBytes}, [this] { Supervise(); });
}

LibusbPort::~LibusbPort() {
  stop_ = true;
  thread_->Join();
  delete held_;
  delete offered_.load();
  delete returned_.load();
}

void LibusbPort::Supervise() {
  Arrivals arrivals;
  std::int64_t look_at_ns = MonotonicNow() + kRetryNs;
  while (!stop_) {
    const bool arrived = arrivals.Wait();
    Collect();
    if (is_away_ || (!arrived && MonotonicNow() < look_at_ns)) continue;
    Look();
    look_at_ns = MonotonicNow() + kRetryNs;
  }
}

// Closes what the tick handed back. // SYNC: returned_
void LibusbPort::Collect() {
  const std::unique_ptr<UsbConnection> back(returned_.exchange(nullptr, std::memory_order_acquire));
  if (back == nullptr) return;
  const UsbTrouble why = why_returned_.load(std::memory_order_relaxed);
  Say(why, WhyReturned(why));
  is_away_ = false;
}

// SYNC: offered_
void LibusbPort::Look() {
  try {
    OpenBoard board = FindBoard(usb_);
    const int switch_id = board.switch_id;
    const std::string serial = board.serial;
    SetUpBoard(board, usb_, rest_tension_n_, !opened_before_);
    auto connection = std::make_unique<UsbConnection>(std::move(board));
    // From now on only this one will do.
    opened_before_ = true;
    usb_.switch_id = switch_id;
    if (!serial.empty()) usb_.serial = serial;
    is_away_ = true;
    Say(UsbTrouble::kNone, "");
    offered_.store(connection.release(), std::memory_order_release);
  } catch (const UsbError& error) {
    Say(error.trouble(), error.what());
  } catch (const std::exception& error) {
    Say(UsbTrouble::kTransferFailed, error.what());
  }
}

void LibusbPort::Say(UsbTrouble trouble, const std::string& complaint) {
  const std::lock_guard lock(mutex_);
  absence_.store(trouble, std::memory_order_relaxed);
  complaint_ = complaint;
}

bool LibusbPort::Take() noexcept {
  if (held_ == nullptr) held_ = offered_.exchange(nullptr, std::memory_order_acquire);
  return held_ != nullptr;
}

bool LibusbPort::Send(UsbPurpose purpose, std::span<const std::uint8_t> packet) noexcept {
  return held_ != nullptr && held_->Send(purpose, packet);
}

std::optional<std::span<const std::uint8_t>> LibusbPort::Receive(
    std::int64_t deadline_ns) noexcept {
  return held_ == nullptr ? std::nullopt : held_->Receive(deadline_ns);
}

UsbTrouble LibusbPort::trouble() const noexcept {
  return held_ == nullptr ? UsbTrouble::kUnplugged : held_->trouble();
}

void LibusbPort::GiveUp(UsbTrouble why) noexcept {
  if (held_ == nullptr) return;
  why_returned_.store(why, std::memory_order_relaxed);
  absence_.store(why, std::memory_order_relaxed);
  returned_.store(held_, std::memory_order_release);
  held_ = nullptr;
}

UsbTrouble LibusbPort::absence() const noexcept {
  return absence_.load(std::memory_order_relaxed);
}

std::string LibusbPort::Complaint() const {
  const std::lock_guard lock(mutex_);
  return complaint_;
}

std::string LibusbPort::Name() const {
  if (usb_.board == UsbBoardModel::kMouse) return "SPIDAR-mouse on USB";
  return "SPIDAR on USB " + std::string(usb_.board == UsbBoardModel::kSimple ? "Simple" : "Sh4");
}

}  // namespace rikiseki::haptic
