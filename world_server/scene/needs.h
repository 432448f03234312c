// What a scene needs of the world, and what is left out because it does not. design decision 11.
#pragma once

#include <cstdint>
#include <string>

#include "world_server/scene/scene.h"

namespace rikiseki::world {

/// Bits of protocol::SceneNeed; what is in neither is done anyway.
struct SceneNeeds {
  std::uint64_t needs = 0;
  std::uint64_t left_out = 0;
};

SceneNeeds WorkOutNeeds(const Scene& scene);

/// "moving bodies, drag"; "nothing" without a bit.
std::string InWords(std::uint64_t needs);

}  // namespace rikiseki::world
