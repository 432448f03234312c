// SPDX-License-Identifier: MIT
// What of the settings may change while the loop runs, and how: not at once but over kTuningRampS, so that
// no change steps the force. The values come from another thread through a slot that never waits.
#pragma once

#include <atomic>
#include <string>
#include <vector>

#include "haptic_server/settings.h"

namespace rikiseki::haptic {

/// The time over which stiffness, damping, caps and filters go to their new values, s. They move
/// linearly: 10 mm deep in a wall, 1 kN/m more comes as 20 N/s.
inline constexpr double kTuningRampS = 0.5;

/// The settings that move.
struct Tuning {
  double stiffness_n_per_m = 0;
  double damping_ns_per_m = 0;
  double friction_stiffness_n_per_m = 0;
  double force_cap_n = 0;
  double slew_limit_n_per_s = 0;
  double speed_limit_m_per_s = 0;
  double light_damping_ns_per_m = 0;
  double soft_start_ms = 0;
  double fade_ms = 0;
  double velocity_cutoff_hz = 0;
  bool operator==(const Tuning&) const = default;
};

Tuning TuningOf(const Settings& settings);

/// From `from` (fraction 0) to `to` (1). // RT:
Tuning Between(const Tuning& from, const Tuning& to, double fraction) noexcept;

/// Puts the values back where they came from. // RT:
void Adopt(const Tuning& tuning, Settings& settings) noexcept;

/// Their names.
std::vector<std::string> LiveKeys();

/// One Tuning on its way from the supervisor to the loop.
class TuningSlot {
 public:
  /// False, and nothing is put in, while the loop has not taken the one before.
  bool Offer(const Tuning& tuning) noexcept;
  /// False if there is nothing. // RT:
  bool Take(Tuning& tuning) noexcept;

 private:
  Tuning tuning_;
  std::atomic<bool> full_{false};
};

/// The values as they move. // RT:
class TuningRamp {
 public:
  TuningRamp(const Tuning& start, double period_s) : from_(start), to_(start), now_(start) {
    step_ = period_s / kTuningRampS;
  }

  /// Goes to these from where it is.
  void Start(const Tuning& target) noexcept {
    from_ = now_;
    to_ = target;
    fraction_ = 0;
  }

  bool moves() const noexcept { return fraction_ < 1; }

  /// The values of the next tick.
  const Tuning& Advance() noexcept;

 private:
  Tuning from_, to_, now_;
  double step_;
  double fraction_ = 1;
};

}  // namespace rikiseki::haptic
