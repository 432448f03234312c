// SPDX-License-Identifier: MIT
// From what the haptic side sent to velocity kicks: the paper's impulses (3.5), or the conventional
// method's penalty from the sampled finger position (1.2).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "world_server/coupling/ledger_reader.h"
#include "world_server/features/planes.h"
#include "world_server/physics/dynamics_world.h"
#include "world_server/scene/scene.h"

namespace rikiseki::world {

/// `impulse`: one kick per body, at its present centre.
std::vector<Kick> ImpulseKicks(std::span<const OwedPush> owed, std::span<const BodyState> states);

/// What `position` renders with.
struct PenaltyLaw {
  double stiffness_n_per_m = 0;   // of surfaces that bring none of their own
  double period_s = 0;            // Tw
  double largest_impulse_ns = 0;  // of one finger on one body per world tick
};

/// `position`: every finger pushes every moving body that it overlaps by k_p depth Tw against the
/// normal of the deepest shape, at the finger's surface point. `dynamics` knows the surfaces of soft
/// bodies: of those the unloaded one counts, with the stiffness of spring and body in series.
std::vector<Kick> PenaltyKicks(const Scene& scene, std::span<const BodyState> states,
                               std::span<const Finger> fingers, const PenaltyLaw& law,
                               const DynamicsWorld* dynamics = nullptr);

}  // namespace rikiseki::world
