// SPDX-License-Identifier: MIT
// --calibrate: the grip is held in the middle, then led through the space; the strings' lengths tell where
// the motors are. The strings are at minimum tension all the while.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <vector>

#include "haptic_server/device/motor_board.h"
#include "haptic_server/device/spidar_kinematics.h"
#include "haptic_server/device/tension.h"
#include "haptic_server/guided/guided_task.h"
#include "haptic_server/settings.h"

namespace rikiseki::haptic {

class CalibrationTask final : public GuidedTask {
 public:
  /// So many places, each a few per cent of the space from the one before.
  static constexpr std::size_t kPlaces = 400;

  /// `board` outlives it.
  CalibrationTask(const Settings& settings, MotorBoard& board);

  bool Tick(const TickTime& time, const OperatorInput& wish) noexcept override;
  void Release() noexcept override;
  std::string Prompt() const override;
  Finding Result() const override;

 private:
  using Counts = std::array<double, kTensionStrings>;

  void Hold(std::int64_t now_ns, const EncoderCounts& counts) noexcept;
  void Lead(std::int64_t now_ns, const EncoderCounts& counts) noexcept;

  SpidarSettings spidar_;
  MotorBoard& board_;
  double apart_m_ = 0;
  std::int64_t held_since_ns_ = 0;
  double held_readings_ = 0;
  Counts held_first_{};
  Counts held_sum_{};
  Counts middle_{};
  bool is_led_ = false;  // the middle is known
  Counts last_{};        // of the tick before
  std::int64_t last_ns_ = 0;
  std::vector<PerString> places_;  // string lengths since the middle, m
  std::atomic<std::size_t> progress_{0};
  std::atomic<bool> is_held_{false};
};

}  // namespace rikiseki::haptic
