// SPDX-License-Identifier: MIT
// The haptic loop around its step: wakes at the haptic rate, reads the newest world frame, runs the tick,
// publishes it. The thread that runs it may be real-time, so nothing below allocates, locks, logs or
// throws.
#pragma once

#include <atomic>
#include <cstdint>

#include "haptic_server/operator_panel.h"
#include "haptic_server/settings.h"
#include "haptic_server/step.h"
#include "protocol/owner.h"
#include "protocol/peer_link.h"
#include "protocol/stream.h"

namespace rikiseki::haptic {

class HapticLoop {
 public:
  /// All outlive the loop.
  HapticLoop(const Settings& settings, HapticStep& step, protocol::SegmentOwner& owner,
             protocol::PeerLink& link, OperatorPanel& panel);

  /// Hands other settings to the running loop; false while it has not taken those before.
  bool Tune(const Tuning& tuning) noexcept { return tuning_.Offer(tuning); }

  /// What the scheduler gave; shown to whoever asks for health.
  void SetScheduling(const protocol::Scheduling& scheduling) { scheduling_ = scheduling; }
  const protocol::Scheduling& scheduling() const noexcept { return scheduling_; }

  /// Ticks until told to stop, then lets the force fade and the device go. // RT:
  void Run(const std::atomic<bool>& stop) noexcept;

  /// One tick at `now_ns`, which was due at `deadline_ns`; `missed` deadlines were skipped before. // RT:
  void Tick(std::int64_t now_ns, std::int64_t deadline_ns, std::int64_t missed) noexcept;

  /// The last tick: the device is let go. // RT:
  void Stop() noexcept;

  /// As it was published last. Not while the loop runs.
  const protocol::HapticHealth& health() const noexcept { return health_; }

  /// Why the force is what it is; for the supervisor, from any thread.
  protocol::ForceReason reason() const noexcept { return reason_.load(std::memory_order_relaxed); }

  /// How many ticks were performed: a loop that hangs stands still here. Likewise.
  std::uint64_t progress() const noexcept { return performed_.load(std::memory_order_relaxed); }

  /// Whether the present contact is unstable; likewise.
  bool unstable() const noexcept { return unstable_.load(std::memory_order_relaxed); }

  /// Coupling and period [ns] of the newest frame; 0 = none came yet. Likewise.
  struct WorldMode {
    protocol::Coupling coupling{};
    std::uint64_t period_ns = 0;
    bool operator==(const WorldMode&) const = default;
  };
  WorldMode world_mode() const noexcept {
    return {coupling_.load(std::memory_order_relaxed),
            world_period_ns_.load(std::memory_order_relaxed)};
  }

 private:
  bool IsReleased() noexcept;
  WorldInput ReadWorld() noexcept;
  void PublishTick() noexcept;
  void PublishHealth() noexcept;

  const std::int64_t period_ns_;
  const std::uint64_t health_every_;  // ticks
  HapticStep& step_;
  protocol::SegmentOwner& owner_;
  protocol::PeerLink& link_;
  OperatorPanel& panel_;
  TuningSlot tuning_;

  protocol::MessageWriter<protocol::HapticTick> ticks_;
  protocol::MessageWriter<protocol::HapticHealth> healths_;
  protocol::MessageReader<protocol::WorldFrame> frames_;

  protocol::HapticTick tick_;
  protocol::WorldFrame frame_;
  protocol::HapticHealth health_;
  protocol::Histogram lateness_{};
  protocol::Histogram duration_{};
  protocol::Scheduling scheduling_;
  std::atomic<protocol::ForceReason> reason_{protocol::ForceReason::kWorldAbsent};
  std::atomic<bool> unstable_{false};
  std::atomic<protocol::Coupling> coupling_{protocol::Coupling::kImpulse};
  std::atomic<std::uint64_t> world_period_ns_{0};
  std::int64_t previous_start_ns_ = 0;
  std::atomic<std::uint64_t> performed_{0};  // written by the loop alone
  bool releasing_ = false;
  std::int64_t release_ticks_left_ = 0;
};

}  // namespace rikiseki::haptic
