// SPDX-License-Identifier: MIT
// One tick of the haptic loop over plain state: device.read -> feature track -> contact solve ->
// surface force -> safety -> device.write -> ledger -> local bodies -> message. The
// clock, the device and the peer are passed in: the daemon drives it with real time, the laboratory
// with virtual time.
#pragma once

#include <cstdint>
#include <memory>

#include "haptic_server/device/device.h"
#include "haptic_server/settings.h"
#include "haptic_server/tuning.h"
#include "haptic_server/world_intake.h"
#include "protocol/messages.h"

namespace rikiseki::haptic {

/// When this tick happens.
struct TickTime {
  std::int64_t start_ns = 0;              // t_k
  std::int64_t previous_duration_ns = 0;  // the true t_k - t_(k-1); 0 on the first tick
  std::int64_t missed = 0;                // deadlines skipped between the tick before and this one
};

/// What an operator asks for in this tick, beside what the finger does.
struct OperatorInput {
  bool stop = false;    // emergency stop: minimum tension in this tick already, until enabled
  bool enable = false;  // ends it, unless something asks for it in the same tick
  bool clutch = false;  // the hand moves, the finger's point in the world stays, without force
};

/// The haptic loop's state between ticks. Everything is allocated by the constructor.
class HapticStep {
 public:
  /// `device` outlives the step. `own_epoch` is the epoch of the segment that the messages will be
  /// published in; frames that acknowledge another one cover nothing. 0 accepts any (the
  /// laboratory). Throws std::invalid_argument on settings that CheckSettings refuses.
  HapticStep(const Settings& settings, Device& device, std::uint64_t own_epoch);
  ~HapticStep();
  HapticStep(const HapticStep&) = delete;
  HapticStep& operator=(const HapticStep&) = delete;

  /// Runs one tick and fills the message to publish. // RT: no allocation, lock, log or throw.
  void Tick(const TickTime& time, const WorldInput& world, protocol::HapticTick& message,
            const OperatorInput& wish = {}) noexcept;

  /// From the next tick on, stiffness, damping, caps and filters go to these values over kTuningRampS.
  /// They must be of settings that CheckSettings accepts. // RT:
  void Tune(const Tuning& target) noexcept;

  /// Zero force and minimum tension at `now_ns`, until when the force of the last tick was held; the
  /// message says kStopped. // RT:
  void Stop(std::int64_t now_ns, protocol::HapticTick& message) noexcept;

  /// Reason, peer, books and extremes; the shell adds what it knows of the loop. // RT:
  const protocol::HapticHealth& health() const noexcept;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace rikiseki::haptic
