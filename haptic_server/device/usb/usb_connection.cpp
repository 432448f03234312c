// SPDX-License-Identifier: MIT
#include "haptic_server/device/usb/usb_connection.h"

#include <algorithm>
#include <string>
#include <utility>

#include "common/clock.h"
#include "haptic_server/device/usb/usb_error.h"

namespace rikiseki::haptic {
namespace {

constexpr std::int64_t kCloseWithinNs = 100'000'000;
constexpr unsigned kZeroWithinMs = 50;
constexpr std::int64_t kLongestWaitNs = 50'000'000;  // whatever deadline a caller makes up

UsbTrouble TroubleOf(int error) {
  switch (error) {
    case LIBUSB_ERROR_NO_DEVICE:
      return UsbTrouble::kUnplugged;
    case LIBUSB_ERROR_PIPE:
      return UsbTrouble::kStalled;
    case LIBUSB_ERROR_TIMEOUT:
      return UsbTrouble::kSilent;
    default:
      return UsbTrouble::kTransferFailed;
  }
}

// Either way, and waits. How many bytes went, or libusb's error.
int TransferNow(const OpenBoard& board, std::uint8_t endpoint, std::span<std::uint8_t> bytes,
                unsigned timeout_ms) {
  const auto transfer = board.pipes.type == LIBUSB_TRANSFER_TYPE_INTERRUPT
                            ? libusb_interrupt_transfer
                            : libusb_bulk_transfer;
  int moved = 0;
  const int error = transfer(board.handle.get(), endpoint, bytes.data(),
                             static_cast<int>(bytes.size()), &moved, timeout_ms);
  return error == 0 ? moved : error;
}

}  // namespace

void OpenBoard::Write(std::span<const std::uint8_t> packet, unsigned timeout_ms) {
  const int sent =
      TransferNow(*this, pipes.out_endpoint,
                  {const_cast<std::uint8_t*>(packet.data()), packet.size()}, timeout_ms);
  if (sent != static_cast<int>(packet.size())) {
    const int error = std::min(sent, 0);
    throw UsbError(TroubleOf(error),
                   "the board at " + place + " takes no command: " + libusb_error_name(error));
  }
}

std::vector<std::uint8_t> OpenBoard::Read(unsigned timeout_ms) {
  std::vector<std::uint8_t> reply(pipes.answer_bytes);
  const int received = TransferNow(*this, pipes.in_endpoint, reply, timeout_ms);
  if (received < 0 && received != LIBUSB_ERROR_TIMEOUT) {
    throw UsbError(TroubleOf(received),
                   "the board at " + place + " gives no answer: " + libusb_error_name(received));
  }
  reply.resize(static_cast<std::size_t>(std::max(received, 0)));
  return reply;
}

UsbConnection::UsbConnection(OpenBoard board) : board_(std::move(board)) {
  const auto fill = [&](Slot& slot, std::uint8_t endpoint, std::size_t bytes,
                        libusb_transfer_cb_fn completed) {
    slot.owner = this;
    slot.transfer.reset(libusb_alloc_transfer(0));
    // No time limit of libusb's: it would arm a timer with each; the tick has its own deadline.
    libusb_fill_bulk_transfer(slot.transfer.get(), board_.handle.get(), endpoint,
                              slot.buffer.data(), static_cast<int>(bytes), completed, &slot, 0);
    slot.transfer->type = static_cast<unsigned char>(board_.pipes.type);
  };
  for (Slot& slot : in_) {
    fill(slot, board_.pipes.in_endpoint, board_.pipes.answer_bytes, InCompleted);
  }
  for (Slot& slot : out_) fill(slot, board_.pipes.out_endpoint, 0, OutCompleted);
  for (Slot& slot : in_) {
    if (!Submit(slot)) {
      Drain(MonotonicNow() + kCloseWithinNs);
      throw UsbError(trouble_, "the board at " + board_.place + " takes no transfers");
    }
  }
  // Everything is open now, so this list stays as it is.
  const libusb_pollfd** list = libusb_get_pollfds(board_.context.get());
  for (std::size_t i = 0; list != nullptr && list[i] != nullptr; ++i) {
    descriptors_.push_back({.fd = list[i]->fd, .events = list[i]->events, .revents = 0});
  }
  libusb_free_pollfds(list);
}

UsbConnection::~UsbConnection() {
  // A command that is under way may be the one that lets the motors go.
  const std::int64_t deadline_ns = MonotonicNow() + kCloseWithinNs;
  while (std::any_of(out_.begin(), out_.end(), [](const Slot& s) { return s.is_under_way; }) &&
         trouble_ != UsbTrouble::kUnplugged && MonotonicNow() < deadline_ns) {
    SleepUntil(MonotonicNow() + 1'000'000);
    HandleEvents();
  }
  Drain(MonotonicNow() + kCloseWithinNs);
  if (trouble_ != UsbTrouble::kUnplugged) {
    if (trouble_ == UsbTrouble::kStalled) {
      libusb_clear_halt(board_.handle.get(), board_.pipes.out_endpoint);
    }
    try {
      board_.Write(board_.zero_packet, kZeroWithinMs);
    } catch (const UsbError&) {  // then the firmware has to
    }
  }
  libusb_release_interface(board_.handle.get(), board_.interface_number);
  for (auto* slots : {in_.data(), out_.data()}) {
    const std::size_t count = slots == in_.data() ? in_.size() : out_.size();
    for (std::size_t i = 0; i < count; ++i) {
      // What libusb did not give back within the time may not be freed: it is left to leak.
      if (slots[i].is_under_way) (void)slots[i].transfer.release();
    }
  }
}

// Ends every transfer. After this no callback comes any more, or the time is over.
void UsbConnection::Drain(std::int64_t deadline_ns) noexcept {
  closing_ = true;
  const auto any = [&] {
    const auto is_under_way = [](const Slot& slot) { return slot.is_under_way; };
    return std::any_of(in_.begin(), in_.end(), is_under_way) ||
           std::any_of(out_.begin(), out_.end(), is_under_way);
  };
  for (Slot& slot : in_) {
    if (slot.is_under_way) libusb_cancel_transfer(slot.transfer.get());
  }
  for (Slot& slot : out_) {
    if (slot.is_under_way) libusb_cancel_transfer(slot.transfer.get());
  }
  while (any() && MonotonicNow() < deadline_ns) {
    timeval patience{.tv_sec = 0, .tv_usec = 5'000};
    libusb_handle_events_timeout_completed(board_.context.get(), &patience, nullptr);
  }
}

bool UsbConnection::Submit(Slot& slot) noexcept {
  const int error = libusb_submit_transfer(slot.transfer.get());
  slot.is_under_way = error == 0;
  if (error != 0 && trouble_ == UsbTrouble::kNone) trouble_ = TroubleOf(error);
  return slot.is_under_way;
}

void UsbConnection::Judge(libusb_transfer_status status) noexcept {
  if (closing_ || status == LIBUSB_TRANSFER_COMPLETED) return;
  const UsbTrouble trouble = status == LIBUSB_TRANSFER_NO_DEVICE ? UsbTrouble::kUnplugged
                             : status == LIBUSB_TRANSFER_STALL   ? UsbTrouble::kStalled
                                                                 : UsbTrouble::kTransferFailed;
  // Whatever failed before, a board that is gone is gone.
  if (trouble_ == UsbTrouble::kNone || trouble == UsbTrouble::kUnplugged) trouble_ = trouble;
}

void UsbConnection::InCompleted(libusb_transfer* transfer) noexcept {
  Slot& slot = *static_cast<Slot*>(transfer->user_data);
  UsbConnection& self = *slot.owner;
  slot.is_under_way = false;
  self.Judge(transfer->status);
  if (self.closing_ || transfer->status != LIBUSB_TRANSFER_COMPLETED) return;
  if (self.arrived_ - self.taken_ < kReplies) {
    Reply& reply = self.replies_[self.arrived_++ % kReplies];
    reply.size = static_cast<std::size_t>(transfer->actual_length);
    std::copy_n(slot.buffer.begin(), reply.size, reply.bytes.begin());
  } else {  // nobody asked for so many
    self.trouble_ = UsbTrouble::kTransferFailed;
    return;
  }
  self.Submit(slot);
}

void UsbConnection::OutCompleted(libusb_transfer* transfer) noexcept {
  Slot& slot = *static_cast<Slot*>(transfer->user_data);
  slot.is_under_way = false;
  slot.owner->Judge(transfer->status);
}

void UsbConnection::HandleEvents() noexcept {
  timeval at_once{};
  libusb_handle_events_timeout_completed(board_.context.get(), &at_once, nullptr);
}

bool UsbConnection::Send(UsbPurpose purpose, std::span<const std::uint8_t> packet) noexcept {
  Slot& slot = out_[static_cast<std::size_t>(purpose)];
  if (slot.is_under_way) HandleEvents();
  const bool is_lost =
      trouble_ == UsbTrouble::kUnplugged || trouble_ == UsbTrouble::kTransferFailed;
  if (slot.is_under_way || is_lost || packet.size() > slot.buffer.size()) return false;
  std::copy(packet.begin(), packet.end(), slot.buffer.begin());
  slot.transfer->length = static_cast<int>(packet.size());
  return Submit(slot);
}

std::optional<std::span<const std::uint8_t>> UsbConnection::Receive(
    std::int64_t deadline_ns) noexcept {
  const std::int64_t limit_ns = std::min(deadline_ns, MonotonicNow() + kLongestWaitNs);
  while (arrived_ == taken_) {
    HandleEvents();
    if (arrived_ != taken_) break;
    const std::int64_t left_ns = limit_ns - MonotonicNow();
    if (left_ns <= 0 || trouble_ != UsbTrouble::kNone) return std::nullopt;
    const timespec left{.tv_sec = 0, .tv_nsec = left_ns};
    ppoll(descriptors_.data(), descriptors_.size(), &left, nullptr);
  }
  const Reply& reply = replies_[taken_++ % kReplies];
  return std::span<const std::uint8_t>(reply.bytes.data(), reply.size);
}

}  // namespace rikiseki::haptic
