// SPDX-License-Identifier: MIT
// --z-width: how stiff a wall the device bears with nobody's hand at it. A spring and damper along x hold the
// grip, left alone; each level of stiffness, 2 % above the one before, gives it a tap, and the first at
// which the tap does not die away is the limit.
#pragma once

#include <atomic>
#include <limits>

#include "haptic_server/guided/centring.h"
#include "haptic_server/guided/guarded_device.h"
#include "haptic_server/guided/guided_task.h"

namespace rikiseki::haptic {

class StiffnessRamp final : public GuidedTask {
 public:
  /// A limit cycle is let go at the end of the level in which it began: no later than this after it, or
  /// three periods where they are longer.
  static constexpr double kLevelS = 0.15;

  /// `device` outlives it.
  StiffnessRamp(const Settings& settings, Device& device);

  bool Tick(const TickTime& time, const OperatorInput& wish) noexcept override;
  void Release() noexcept override { device_.Release(); }
  std::string Prompt() const override;
  Finding Result() const override;

  /// N/m, at which the limit cycle began; the present one before.
  double stiffness() const noexcept { return stiffness_.load(std::memory_order_relaxed); }

 private:
  enum class Phase { kSettle, kRamp, kLimitCycle, kTooWeak, kInterrupted };

  // Between the outermost places of a part of a level.
  struct Swing {
    double low = std::numeric_limits<double>::max();
    double high = std::numeric_limits<double>::lowest();
    void Add(double x) noexcept;
    double width() const noexcept { return high > low ? high - low : 0; }
  };

  void BeginLevel(double stiffness) noexcept;
  double Wall(double x, double dt_s) const noexcept;
  void Judge(double x) noexcept;

  Settings settings_;
  GuardedDevice device_;
  Centring centring_;
  double in_phase_s_ = 0;
  double last_x_ = 0;
  double tap_m_ = 0;     // that the middle of the spring jumps by
  double middle_m_ = 0;  // of the spring
  double part_s_ = 0;    // a third of the level
  Swing early_;          // in its second third
  Swing late_;           // in its last
  int limited_ticks_ = 0;
  std::atomic<double> stiffness_{0};
  std::atomic<Phase> phase_{Phase::kSettle};
};

}  // namespace rikiseki::haptic
