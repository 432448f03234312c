// SPDX-License-Identifier: MIT
#include "tests/usb/emulated_board.h"

#include <algorithm>
#include <cmath>

#include "haptic_server/device/hand.h"

namespace rikiseki::test {
namespace {

using haptic::EncoderCounts;
using haptic::PerString;
using haptic::UsbBoardModel;

std::uint16_t Word(std::span<const std::uint8_t> bytes, std::size_t at) {
  return static_cast<std::uint16_t>(bytes[at] + 256 * bytes[at + 1]);
}

void PutWord(std::vector<std::uint8_t>& bytes, std::size_t at, std::uint64_t value) {
  bytes[at] = static_cast<std::uint8_t>(value % 256);
  bytes[at + 1] = static_cast<std::uint8_t>(value / 256 % 256);
}

double OfString(const std::vector<double>& values, std::size_t string) {
  return values.size() == 1 ? values[0] : values[string];
}

haptic::MotorProgram::Script Waiting(const haptic::Settings& settings) {
  haptic::MotorProgram::Script script;
  script.home = ScriptOf(settings.hand).home;
  return script;
}

}  // namespace

EmulatedBoard::EmulatedBoard(const haptic::Settings& settings, int switch_id, Begins begins)
    : settings_(settings),
      switch_id_(switch_id),
      program_(begins == Begins::kByItself ? ScriptOf(settings.hand) : Waiting(settings)),
      board_(settings.spidar,
             {[this](double t_s) { return HandTarget(t_s); }, ImpedanceOf(settings)}) {}

Vec3 EmulatedBoard::HandTarget(double t_s) {
  if (is_requested_) {
    is_requested_ = false;
    auto once = ScriptOf(settings_.hand);
    once.repeats = false;
    program_ = haptic::MotorProgram(once);
    begun_s_ = t_s;
  }
  return program_(t_s - begun_s_);
}

void EmulatedBoard::HoldInTheMiddle(int ticks, std::int64_t tick_ns) {
  held_until_ns_ = ticks * tick_ns;
  carried_until_ns_ = 2 * held_until_ns_;
}

std::optional<std::vector<std::uint8_t>> EmulatedBoard::Handle(std::span<const std::uint8_t> packet,
                                                               std::int64_t now_ns) {
  if (faults.foreign_firmware) return std::vector<std::uint8_t>(64, 0x5A);
  auto reply = settings_.usb.board == UsbBoardModel::kSimple ? HandleSimple(packet, now_ns)
                                                             : HandleSh4(packet, now_ns);
  if (reply && faults.reply_bytes) reply->resize(*faults.reply_bytes);
  return reply;
}

std::optional<std::vector<std::uint8_t>> EmulatedBoard::HandleSimple(
    std::span<const std::uint8_t> packet, std::int64_t now_ns) {
  if (packet.size() != 32) {
    ++nonsense_;
    return std::nullopt;
  }
  if (packet[0] == 0xA2 && packet[1] == 0x1A) {
    phase_ = packet[2];
    set_up_.push_back({packet[1], packet[2]});
    return std::nullopt;
  }
  if (packet[0] == 0xA2 && packet[1] == 0x19) {
    for (std::size_t channel = 0; channel < 8; ++channel) {
      if ((packet[2] >> channel & 1) != 0) cleared_at_[channel] = counters_[channel];
    }
    set_up_.push_back({packet[1], packet[2]});
    return std::nullopt;
  }
  if (packet[0] == 0x52) {
    Command(packet.subspan(1, 16));
    return std::nullopt;
  }
  if (packet[0] != 0x51) {
    ++nonsense_;
    return std::nullopt;
  }
  Advance(now_ns);
  std::vector<std::uint8_t> reply(32);
  for (std::size_t channel = 0; channel < 8; ++channel) {
    const std::int64_t since = counters_[channel] - cleared_at_[channel];
    const auto bits = static_cast<std::uint64_t>((phase_ >> channel & 1) != 0 ? since : -since);
    PutWord(reply, 3 * channel, bits);
    reply[3 * channel + 2] = static_cast<std::uint8_t>(bits >> 16);
  }
  reply[24] = static_cast<std::uint8_t>(inputs | switch_id_ << 4);
  return reply;
}

std::optional<std::vector<std::uint8_t>> EmulatedBoard::HandleSh4(
    std::span<const std::uint8_t> packet, std::int64_t now_ns) {
  if (packet.size() != 512 || packet[0] != 0x01 || packet[1] != 0x0E) {
    ++nonsense_;
    return std::nullopt;
  }
  Command(packet.subspan(2, 16));
  Advance(now_ns);
  std::vector<std::uint8_t> reply(512, 0xEE);
  for (std::size_t channel = 0; channel < 8; ++channel) {
    PutWord(reply, 2 * channel, faults.wrong_echo ? 0x1234 : digits_[channel]);
    PutWord(reply, 16 + 2 * channel,
            static_cast<std::uint64_t>(counters_[channel] - cleared_at_[channel]));
    PutWord(reply, 32 + 2 * channel, 0);
  }
  PutWord(reply, 48, static_cast<std::uint64_t>(inputs | switch_id_ << 4));
  return reply;
}

void EmulatedBoard::Command(std::span<const std::uint8_t> words) {
  for (std::size_t channel = 0; channel < 8; ++channel) digits_[channel] = Word(words, 2 * channel);
  uncommanded_ticks_ = 0;
  ++commands_;
}

void EmulatedBoard::FirmwareTick() {
  ++uncommanded_ticks_;
  if (uncommanded_ticks_ >= kWatchdogTicks) digits_.fill(0);
  if (!MotorsAtZero()) {
    longest_uncommanded_pull_ = std::max(longest_uncommanded_pull_, uncommanded_ticks_);
  }
}

bool EmulatedBoard::MotorsAtZero() const {
  return std::all_of(digits_.begin(), digits_.end(), [](std::uint16_t d) { return d == 0; });
}

void EmulatedBoard::ForgetCounters() {
  cleared_at_ = counters_;
  phase_ = 0;
}

// Pulls as the D/A says: the tension that a digit stands for is worked out here once more.
void EmulatedBoard::Advance(std::int64_t now_ns) {
  ++readings_;
  EncoderCounts counts{};
  if (now_ns < carried_until_ns_) {
    const double way = static_cast<double>(now_ns - held_until_ns_) /
                       static_cast<double>(carried_until_ns_ - held_until_ns_);
    counts = board_.CountsAt(
        {haptic::MinimumJerk(way) * settings_.hand.home_mm * 1e-3, Quat::Identity()});
  } else {
    PerString tension{};
    for (std::size_t string = 0; string < settings_.usb.channels.size(); ++string) {
      const auto channel = static_cast<std::size_t>(settings_.usb.channels[string]);
      tension[string] = digits_[channel] / OfString(settings_.usb.digit_per_volt, string) /
                        OfString(settings_.usb.volt_per_newton, string);
    }
    board_.WriteTensions(tension);
    board_.ReadCounts(now_ns, counts);
  }
  const int wiring = settings_.usb.board == UsbBoardModel::kSh4 ? -1 : 1;
  for (std::size_t string = 0; string < settings_.usb.channels.size(); ++string) {
    const auto channel = static_cast<std::size_t>(settings_.usb.channels[string]);
    const int flip = settings_.usb.count_directions[string] < 0 ? -1 : 1;
    counters_[channel] = wiring * flip * counts[string];
  }
}

}  // namespace rikiseki::test
