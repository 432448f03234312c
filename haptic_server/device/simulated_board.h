// SPDX-License-Identifier: MIT
// A motor board that is not there, with the physics behind it: strings, their encoders, and the grip
// as one body with the simulated hand that holds it.
#pragma once

#include <span>
#include <vector>

#include "haptic_server/device/hand.h"
#include "haptic_server/device/motor_board.h"
#include "haptic_server/device/tension.h"
#include "haptic_server/settings.h"

namespace rikiseki::haptic {

/// What the hand of the settings does.
MotorProgram::Script ScriptOf(const HandSettings& hand);

/// The hand of the settings as it holds the device of the settings: masses and dampings added.
Impedance ImpedanceOf(const Settings& settings);

/// Both together.
Hand MakeHand(const Settings& settings);

/// The body moves only when the encoders are read: up to that instant, under the tensions written
/// last, whose directions are taken anew at least every millisecond. Tensions act
/// spidar.latency_us after the reading that they answer. Lengths are rounded to whole counts and
/// tensions clamped, as hardware would.
///
/// Strings that end beside the centre of the grip turn it as well. Assumed of the hand: its program
/// drives the centre, and its fingers hold the grip upright like a torsion spring, the same about every
/// axis; turns are small, so that each axis goes by itself.
class SimulatedBoard final : public MotorBoard {
 public:
  /// Throws std::invalid_argument unless there are 4 motors, or 8 with an attachment each.
  SimulatedBoard(const SpidarSettings& spidar, Hand hand);

  bool ReadCounts(std::int64_t now_ns, EncoderCounts& counts) noexcept override;
  bool WriteTensions(const PerString& tension) noexcept override;
  bool Enabled() const noexcept override { return enabled_; }
  const Hand* hand() const noexcept override { return &hand_; }
  std::string Name() const override { return "simulated SPIDAR"; }

  /// Opens and closes the enable input.
  void SetEnabled(bool enabled) noexcept { enabled_ = enabled; }

  /// What the strings pull with [N].
  std::span<const double> tension() const noexcept { return {tension_.data(), motors_.size()}; }

  /// Where the grip is, device axes.
  Pose grip() const noexcept;

  /// What the encoders read when the grip is there. // RT:
  EncoderCounts CountsAt(const Pose& grip) const noexcept;

 private:
  // A command on its way to the motors.
  struct Command {
    std::int64_t acts_ns = 0;
    PerString tension{};
  };
  // One a tick at no more than 8 kHz.
  static constexpr std::size_t kCommands = 128;
  static_assert(kCommands > kLongestLatencyUs * 1e-6 * 8000 + 1);

  void MoveTo(std::int64_t now_ns) noexcept;

  PerString Lengths(const Pose& grip) const noexcept;

  std::vector<Vec3> motors_;       // m, device axes
  std::vector<Vec3> attachments_;  // m, grip axes; all 0 where the strings meet in one point
  PerString home_lengths_;
  double count_length_m_;
  TensionBounds bounds_;
  std::int64_t latency_ns_;
  Hand hand_;
  Hand wrist_;  // in radians: its position is the turn of the grip, axis times angle
  PerString tension_{};
  std::array<Command, kCommands> commands_{};
  std::size_t commanded_ = 0;  // ever
  std::size_t obeyed_ = 0;
  bool enabled_ = true;
  bool started_ = false;
  std::int64_t now_ns_ = 0;
};

}  // namespace rikiseki::haptic
