// SPDX-License-Identifier: MIT
// One tick of the world loop over plain state: read ledger -> coupling (impulse to bodies) -> physics ->
// nearest points -> planes -> frame. Messages, time and dynamics are passed in: the daemon drives it with
// real time, the laboratory with virtual time.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "protocol/messages.h"
#include "world_server/physics/dynamics_world.h"
#include "world_server/scene/scene.h"
#include "world_server/settings.h"
#include "world_server/succession.h"

namespace rikiseki::world {

class WorldStep {
 public:
  /// `own_epoch` is the epoch of the segment that the frames will be published in; 0 accepts ticks
  /// whatever world they were displayed against (the laboratory).
  WorldStep(const Settings& settings, Scene scene, std::unique_ptr<DynamicsWorld> dynamics,
            std::uint64_t own_epoch);
  ~WorldStep();

  /// A (new) haptic epoch: the next message consumed is a baseline only.
  void BeginHapticEpoch(std::uint64_t epoch);

  /// One message of the present haptic epoch, in order. Ticks that were overwritten unread may be
  /// missing between two: totals make up for them.
  void Consume(const protocol::HapticTick& tick);

  /// Applies what was consumed since the last call, advances by `period_s`, finds the planes near every
  /// pointer, and fills the next frame.
  void Tick(double period_s, protocol::WorldFrame& frame);

  /// From the next tick on, another force cap, gap and reach of the features. Nothing else is taken.
  void Tune(const Settings& settings);

  /// Puts another scene in the place of this one, with dynamics that nobody has stepped but Prepare, which
  /// is done here if it was not yet. What is the same keeps its name on the wire, what goes on is where
  /// it was. The books go on: what is pending for a body that is no more is discarded.
  void Replace(Successor successor);

  /// What a successor is prepared from.
  Moment Now() const;

  const Scene& scene() const;

  /// All bodies, for observers.
  const std::vector<protocol::Body>& Bodies() const;

  /// Totals by reason and coupling; the shell adds what it knows of the loop.
  const protocol::WorldHealth& health() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace rikiseki::world
