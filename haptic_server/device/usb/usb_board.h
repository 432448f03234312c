// SPDX-License-Identifier: MIT
// A motor board on the USB: the encoders are asked for, read, and the tensions computed from them are
// sent in the same tick. What comes is trusted only if its length and, on the Sh4, its echo are right.
#pragma once

#include <memory>

#include "haptic_server/device/usb/string_channels.h"
#include "haptic_server/device/usb/usb_port.h"

namespace rikiseki::haptic {

/// So many readings in a row may miss (late, short, wrong) while the counts of the last good one are
/// shown in their place: a millisecond or three in which the force is held.
inline constexpr int kHeldReadings = 3;

/// After so many the board is given up, to be opened anew.
inline constexpr int kHopelessReadings = 20;

/// The counts are 0 where the grip was at the first reading of all: it must be in the middle then. A
/// board that comes back goes on counting. Whether it kept its counters or began anew from 0, for want
/// of power, it does not tell: what the grip would have moved less for is believed.
class UsbBoard final : public MotorBoard {
 public:
  /// `rest_tension_n`: what all strings are pulled with when there is trouble.
  UsbBoard(const UsbSettings& usb, double rest_tension_n, std::unique_ptr<UsbPort> port);

  bool ReadCounts(std::int64_t now_ns, EncoderCounts& counts) noexcept override;
  bool WriteTensions(const PerString& tension) noexcept override;
  bool Enabled() const noexcept override { return enabled_; }
  const Hand* hand() const noexcept override { return nullptr; }
  std::string Name() const override { return port_->Name(); }
  const char* Trouble() const noexcept override;
  std::string Complaint() const override { return port_->Complaint(); }

 private:
  UsbTrouble Exchange(std::int64_t deadline_ns) noexcept;
  UsbTrouble Decode(std::span<const std::uint8_t> bytes, RawCounts& raw) noexcept;
  void Follow(const RawCounts& raw) noexcept;
  bool SendRequest() noexcept;
  bool SendDigits() noexcept;
  void GiveUp(UsbTrouble why) noexcept;

  const UsbBoardModel model_;
  const int count_bits_;
  const int enable_bit_;
  const std::int64_t reply_within_ns_;
  const StringChannels channels_;
  const DaDigits rest_;
  std::unique_ptr<UsbPort> port_;

  bool held_ = false;    // there is a board
  bool is_new_ = false;  // no reading came yet since it was taken
  bool ever_read_ = false;
  bool enabled_ = true;
  int replies_due_ = 0;                   // to packets that were sent
  int missed_ = 0;                        // readings in a row
  UsbTrouble doubt_ = UsbTrouble::kNone;  // of the newest reading
  DaDigits digits_;                       // commanded
  // Of each string: the counter, extended, and what it read with the grip in the middle.
  std::array<std::int64_t, kMaxStrings> counter_{};
  std::array<std::int64_t, kMaxStrings> home_{};
};

}  // namespace rikiseki::haptic
