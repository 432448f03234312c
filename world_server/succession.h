// SPDX-License-Identifier: MIT
// What goes on when another scene takes the place of the running one: bodies, where they are and at their
// velocity, in an engine that has not met them yet.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "common/rigid_body.h"
#include "world_server/physics/dynamics_world.h"
#include "world_server/scene/scene.h"
#include "world_server/scene/scene_change.h"

namespace rikiseki::world {

/// What another scene does to what moves.
enum class Replacement {
  kChange,   // what the scene says differently is changed, everything else goes on: see Changed
  kRestart,  // everything that moves begins anew: see Restarted
};

/// A scene between two ticks.
struct Moment {
  Scene scene;
  std::vector<BodyState> states;
};

/// A scene that is to take another's place, and the dynamics that will run it.
struct Successor {
  Scene scene;
  std::unique_ptr<DynamicsWorld> dynamics;
  Replacement how = Replacement::kChange;
  bool prepared = false;  // by Prepare, of a moment ago
};

std::vector<BodyChange> ChangesOf(const Scene& before, const Successor& successor);

/// Puts what goes on where it is, and lets the new dynamics find the impulses by which bodies at rest carry
/// each other, which the dynamics before knew: by some substeps [s] that are taken back. What rests sleeps.
/// That takes longer than a world period where the scene is large, and is no work for the loop's thread.
void Prepare(const Moment& moment, double substep_s, Successor& successor);

/// Puts what goes on where it is by now. What Prepare left there is not touched.
void PutInPlace(std::span<const BodyChange> changes, std::span<const BodyState> states_before,
                DynamicsWorld& dynamics);

}  // namespace rikiseki::world
