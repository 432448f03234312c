// SPDX-License-Identifier: MIT
// What a scene needs of the world, and what is left out because it does not. design decision 11.
//
// Needed, when some body can move:
//   contacts among them  two bodies can move, and so could meet
//   friction             two bodies that could meet, or the finger and a surface, both rub
//   rotation             a movable body has unequal moments of inertia: it precesses when it turns. Every
//                        body turns; what is left out is what bends its axis
//   drag                 the air acts on a movable body
//   fast bodies          a movable body could meet anything: nobody knows how fast it will be. What that
//                        takes is done only in substeps in which something is fast
//   local bodies         the coupling is `local`
#pragma once

#include <cstdint>
#include <string>

#include "protocol/messages.h"
#include "world_server/scene/scene.h"

namespace rikiseki::world {

/// Bits of protocol::SceneNeed; every one is in exactly one of the two.
struct SceneNeeds {
  std::uint64_t needs = 0;
  std::uint64_t left_out = 0;
};

/// How the scene is used, as far as its needs depend on it.
struct SceneUse {
  protocol::Coupling coupling = protocol::Coupling::kLocal;
  double finger_friction = 0;
};

SceneNeeds WorkOutNeeds(const Scene& scene, const SceneUse& use = {});

/// Whether two bodies, one of which can move, both have a shape of which `is` says true.
bool SomePairHas(const Scene& scene, bool (*is)(const Collider&));

/// "moving bodies, drag"; "nothing" without a bit.
std::string InWords(std::uint64_t needs);

}  // namespace rikiseki::world
