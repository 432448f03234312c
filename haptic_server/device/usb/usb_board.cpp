// SPDX-License-Identifier: MIT
#include "haptic_server/device/usb/usb_board.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <utility>

#include "haptic_server/device/usb/sh4_packets.h"
#include "haptic_server/device/usb/simple_packets.h"

namespace rikiseki::haptic {
namespace {

PerString AllAt(double tension_n) {
  PerString tension;
  tension.fill(tension_n);
  return tension;
}

}  // namespace

UsbBoard::UsbBoard(const UsbSettings& usb, double rest_tension_n, std::unique_ptr<UsbPort> port)
    : model_(usb.board),
      count_bits_(usb.board == UsbBoardModel::kSimple ? simple::kCountBits : sh4::kCountBits),
      enable_bit_(usb.enable_bit),
      reply_within_ns_(std::llround(usb.reply_within_us * 1e3)),
      channels_(usb),
      rest_(channels_.Digits(AllAt(rest_tension_n))),
      port_(std::move(port)),
      digits_(rest_) {}

bool UsbBoard::ReadCounts(std::int64_t now_ns, EncoderCounts& counts) noexcept {
  if (!held_) {
    if (!port_->Take()) return false;
    held_ = true;
    is_new_ = true;
    replies_due_ = 0;
    missed_ = 0;
    digits_ = rest_;
  }
  doubt_ = Exchange(now_ns + reply_within_ns_);
  if (port_->trouble() != UsbTrouble::kNone) {
    GiveUp(port_->trouble());
    return false;
  }
  missed_ = doubt_ == UsbTrouble::kNone ? 0 : missed_ + 1;
  if (missed_ >= kHopelessReadings) {
    GiveUp(doubt_);
    return false;
  }
  if (is_new_ || missed_ > kHeldReadings) return false;
  for (std::size_t string = 0; string < channels_.string_count(); ++string) {
    counts[string] = channels_.direction(string) * (counter_[string] - home_[string]);
  }
  return true;
}

// One question and its answer. An answer that is late is waited for in the next tick, before anything
// else is asked: a board numbers nothing, so it must never be taken for a newer one.
UsbTrouble UsbBoard::Exchange(std::int64_t deadline_ns) noexcept {
  while (replies_due_ > 0) {
    if (!port_->Receive(deadline_ns)) return UsbTrouble::kLateReply;
    --replies_due_;
  }
  if (!SendRequest()) return UsbTrouble::kLateReply;
  const auto reply = port_->Receive(deadline_ns);
  if (!reply) return UsbTrouble::kLateReply;
  --replies_due_;
  RawCounts raw{};
  const UsbTrouble trouble = Decode(*reply, raw);
  if (trouble == UsbTrouble::kNone) Follow(raw);
  return trouble;
}

UsbTrouble UsbBoard::Decode(std::span<const std::uint8_t> bytes, RawCounts& raw) noexcept {
  std::uint16_t parallel_port = 0;
  if (model_ == UsbBoardModel::kSimple) {
    const auto reply = simple::DecodeReply(bytes);
    if (!reply) return UsbTrouble::kShortReply;
    raw = reply->counts;
    parallel_port = reply->parallel_port;
  } else {
    const auto reply = sh4::DecodeReply(bytes);
    if (!reply) return UsbTrouble::kShortReply;
    // The request repeats the digits of the last command, so that it does not matter whether a board
    // echoes what it has just got or what it had before.
    if (reply->echo != digits_) return UsbTrouble::kWrongEcho;
    raw = reply->counts;
    parallel_port = reply->parallel_port;
  }
  enabled_ = enable_bit_ == kNoEnableBit || (parallel_port >> enable_bit_ & 1) != 0;
  return UsbTrouble::kNone;
}

void UsbBoard::Follow(const RawCounts& raw) noexcept {
  std::int64_t moved_if_kept = 0;
  std::int64_t moved_if_anew = 0;
  for (std::size_t string = 0; string < channels_.string_count(); ++string) {
    const std::int32_t now = channels_.Raw(raw, string);
    const std::int64_t kept = ExtendCount(counter_[string], now, count_bits_);
    moved_if_kept = std::max(moved_if_kept, std::abs(kept - counter_[string]));
    moved_if_anew = std::max(moved_if_anew, std::abs(ExtendCount(0, now, count_bits_)));
  }
  const bool began_anew = ever_read_ && is_new_ && moved_if_anew < moved_if_kept;
  for (std::size_t string = 0; string < channels_.string_count(); ++string) {
    if (began_anew) {
      home_[string] -= counter_[string];
      counter_[string] = 0;
    }
    counter_[string] = ExtendCount(counter_[string], channels_.Raw(raw, string), count_bits_);
    if (!ever_read_) home_[string] = counter_[string];
  }
  ever_read_ = true;
  is_new_ = false;
}

bool UsbBoard::SendRequest() noexcept {
  const bool sent = model_ == UsbBoardModel::kSimple
                        ? port_->Send(UsbPurpose::kRequest, simple::EncodeLatch())
                        : port_->Send(UsbPurpose::kRequest, sh4::EncodeUpdate(digits_));
  if (sent) ++replies_due_;
  return sent;
}

// The Sh4 answers a command as well; what it says is of no use then.
bool UsbBoard::SendDigits() noexcept {
  if (model_ == UsbBoardModel::kSimple) {
    return port_->Send(UsbPurpose::kCommand, simple::EncodeDigits(digits_));
  }
  const bool sent = port_->Send(UsbPurpose::kCommand, sh4::EncodeUpdate(digits_));
  if (sent) ++replies_due_;
  return sent;
}

bool UsbBoard::WriteTensions(const PerString& tension) noexcept {
  if (!held_) return false;
  digits_ = channels_.Digits(tension);
  return SendDigits();
}

// The motors first: what can still be sent leaves before the board is let go.
void UsbBoard::GiveUp(UsbTrouble why) noexcept {
  digits_ = rest_;
  SendDigits();
  port_->GiveUp(why);
  held_ = false;
}

const char* UsbBoard::Trouble() const noexcept {
  if (!held_) return InBrief(port_->absence());
  return InBrief(missed_ > kHeldReadings ? doubt_ : UsbTrouble::kNone);
}

}  // namespace rikiseki::haptic
