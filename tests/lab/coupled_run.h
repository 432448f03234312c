// Both loops in virtual time: the step functions that the daemons ship, with a clock that stands
// still during a tick and messages that arrive at once. The order is that of the written
// experiments: before haptic tick k, if it is due, the world ticks on everything up to tick k - 1;
// its frame is shown in k.
#pragma once

#include <cstdint>
#include <memory>

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
  /// The world ticks before haptic ticks phase_ticks, phase_ticks + n, ... with n = world period /
  /// haptic period. `device` outlives the run and must not move before start_ns(). Throws
  /// std::invalid_argument unless n is whole, and if the loops do not meet.
  CoupledRun(const haptic::Settings& haptic_settings, haptic::Device& device,
             const world::Settings& world_settings, const world::Scene& scene,
             std::unique_ptr<world::DynamicsWorld> dynamics, int phase_ticks);

  /// From now on the world sees only the newest message before each of its ticks, as if all others
  /// had been overwritten unread.
  void LapTheWorld() { lapped_ = true; }

  /// When tick 0 happens, in virtual time.
  static std::int64_t StartNs(const haptic::Settings& settings) {
    return kMeetingTicks * settings.period_ns();
  }

  /// One haptic tick, with the world tick before it if that is due. Returns whether it was.
  bool Tick();

  /// Of the last haptic tick.
  const protocol::HapticTick& haptic_tick() const { return haptic_tick_; }
  const protocol::HapticHealth& haptic_health() const { return haptic_.health(); }
  const protocol::WorldFrame& world_frame() const { return world_frame_; }
  const world::WorldStep& world() const { return world_; }

 private:
  void TickWorld(double period_s);
  void TickHaptic();

  std::int64_t haptic_period_ns_;
  std::int64_t ticks_per_period_;  // n
  double world_period_s_;
  std::int64_t phase_ticks_;
  std::int64_t tick_ = -kMeetingTicks;  // k, of the next haptic tick
  haptic::HapticStep haptic_;
  world::WorldStep world_;
  protocol::HapticTick haptic_tick_;
  protocol::WorldFrame world_frame_;
  bool frame_is_new_ = false;
  bool lapped_ = false;
};

}  // namespace rikiseki::lab
