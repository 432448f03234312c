// SPDX-License-Identifier: MIT
// --identify: the grip, left alone, is shaken by a few newtons on all axes at once, and what moves with it
// is worked out from how it moved.
#pragma once

#include <atomic>
#include <vector>

#include "haptic_server/guided/centring.h"
#include "haptic_server/guided/guarded_device.h"
#include "haptic_server/guided/guided_task.h"
#include "haptic_server/guided/identification.h"

namespace rikiseki::haptic {

class IdentificationTask final : public GuidedTask {
 public:
  /// `device` outlives it.
  IdentificationTask(const Settings& settings, Device& device);

  bool Tick(const TickTime& time, const OperatorInput& wish) noexcept override;
  void Release() noexcept override { device_.Release(); }
  std::string Prompt() const override;
  Finding Result() const override;

 private:
  enum class Phase { kSettle, kGrow, kRecord, kDone, kInterrupted };

  void MoveOn(const DeviceSample& sample, double dt_s) noexcept;
  Vec3 Shake() const noexcept;

  GuardedDevice device_;
  double reach_m_;
  double fastest_m_per_s_;
  double most_n_;
  Centring centring_;
  double shaking_s_ = 0;
  double amplitude_n_ = 0;
  double in_phase_s_ = 0;
  std::atomic<Phase> phase_{Phase::kSettle};
  std::vector<MotionRecord> records_;
};

}  // namespace rikiseki::haptic
