// SPDX-License-Identifier: MIT
// Both loops in virtual time: the step functions that the daemons ship, with a clock that stands
// still during a tick, and frames that arrive at once or a stated number of haptic ticks later. The
// order is that of the written experiments: before haptic tick k, if it is due, the world ticks on
// everything up to tick k - 1; its frame is shown in k + latency.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <utility>

#include "haptic_server/device/device.h"
#include "haptic_server/settings.h"
#include "haptic_server/step.h"
#include "protocol/messages.h"
#include "world_server/physics/dynamics_world.h"
#include "world_server/scene/scene.h"
#include "world_server/settings.h"
#include "world_server/step.h"

namespace rikiseki::lab {

/// Before tick 0 the two loops meet, in this many haptic ticks in which the world stands still: one
/// tells the world where the finger is, and three fresh frames make the haptic side call the world
/// live.
inline constexpr int kMeetingTicks = 4;

class CoupledRun {
 public:
  /// The world ticks before haptic tick phase_ticks, and then before the first haptic tick at or
  /// after every further world period. A frame is shown latency_ticks after the tick that it was
  /// made before, its acks unchanged; during the meeting, at once. `device` outlives the run and
  /// must not move before StartNs(). Throws std::invalid_argument if the loops do not meet.
  CoupledRun(const haptic::Settings& haptic_settings, haptic::Device& device,
             const world::Settings& world_settings, const world::Scene& scene,
             std::unique_ptr<world::DynamicsWorld> dynamics, int phase_ticks,
             int latency_ticks = 0);

  /// From now on the world sees only the newest message before each of its ticks, as if all others
  /// had been overwritten unread.
  void LapTheWorld() { lapped_ = true; }

  /// When tick 0 happens, in virtual time.
  static std::int64_t StartNs(const haptic::Settings& settings) {
    return kMeetingTicks * settings.period_ns();
  }

  /// One haptic tick, with the world tick before it if that is due. Returns whether it was. A world
  /// tick advances the world to the time of the haptic ticks that it consumed; the first one, by
  /// the world's whole period.
  bool Tick(const haptic::OperatorInput& wish = {});

  /// From now on every frame is altered on its way to the haptic side.
  void AlterFrames(std::function<void(protocol::WorldFrame&)> alter) { alter_ = std::move(alter); }

  /// Between two ticks another scene takes the place of the one that runs, as when its file changes.
  void ReplaceScene(const world::Scene& scene, std::unique_ptr<world::DynamicsWorld> dynamics,
                    world::Replacement how) {
    world_.Replace({.scene = scene, .dynamics = std::move(dynamics), .how = how});
  }

  /// A silent world misses its ticks, shows no frame and no sign of life; afterwards it goes on
  /// where it stopped, and makes up for at most the gap of its settings.
  void SilenceWorld(bool silent) { world_is_silent_ = silent; }

  /// Of the last haptic tick.
  const protocol::HapticTick& haptic_tick() const { return haptic_tick_; }
  const protocol::HapticHealth& haptic_health() const { return haptic_.health(); }
  /// The newest, shown already or not.
  const protocol::WorldFrame& world_frame() const { return world_frame_; }
  const world::WorldStep& world() const { return world_; }

  /// How long this computer worked on the last haptic tick, and on the last world tick with what it
  /// consumed, by the wall clock. For studies of cost alone: no result may depend on it.
  struct Effort {
    double haptic_s = 0;
    double world_s = 0;
  };
  const Effort& effort() const { return effort_; }

 private:
  struct Sent {
    std::int64_t shown_in = 0;  // haptic tick
    protocol::WorldFrame frame;
  };

  void TickWorld(std::int64_t advance_ns);
  void TickHaptic(const haptic::OperatorInput& wish);
  void Consume();

  std::int64_t haptic_period_ns_;
  std::int64_t world_period_ns_;
  std::int64_t longest_advance_ns_;
  std::int64_t latency_ticks_;
  std::int64_t tick_ = -kMeetingTicks;  // k, of the next haptic tick
  std::int64_t world_due_ns_;           // of the next world tick, from tick 0 on
  std::int64_t world_clock_ns_ = 0;     // up to where the world came, likewise
  std::int64_t heartbeat_ns_ = 0;       // of the world, in virtual time
  bool world_is_silent_ = false;
  haptic::HapticStep haptic_;
  world::WorldStep world_;
  protocol::HapticTick haptic_tick_;
  protocol::WorldFrame world_frame_;
  bool lapped_ = false;
  std::function<void(protocol::WorldFrame&)> alter_;
  Effort effort_;
  double consuming_s_ = 0;  // since the last world tick
  std::deque<Sent> under_way_;
};

}  // namespace rikiseki::lab
