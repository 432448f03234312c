// SPDX-License-Identifier: MIT
// `local`: the world repeats the push as it was displayed, tick by tick, so that it moves as the
// haptic side's copies did. Substeps as long as a tick only where the finger pushed. numerics 4.
#pragma once

#include <map>

#include "world_server/coupling/ledger_reader.h"
#include "world_server/physics/dynamics_world.h"
#include "world_server/physics/push_budget.h"

namespace rikiseki::world {

/// By the body's place in the scene.
using PushBudgets = std::map<std::size_t, PushBudget>;

/// Advances the world by `period_s`: every tick's impulses as pushes, then the length of the
/// tick; all of it is one DynamicsWorld::Play. Where messages were lost, their sum enters in as many blocks as
/// ticks were lost, in a linear profile that has the same impulse and the same first moment. What
/// the ticks do not cover passes before them; where they cover more, they are shortened alike.
/// `largest_impulse_ns` bounds what a first moment may say; bodies that have one of `budgets` take what
/// it allows.
void ReplayPush(const Replay& replay, double period_s, double largest_impulse_ns,
                DynamicsWorld& world, PushBudgets* budgets = nullptr);

}  // namespace rikiseki::world
