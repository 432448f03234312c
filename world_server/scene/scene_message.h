// SPDX-License-Identifier: MIT
// What the world tells observers of its scene, once per load: names, shapes, places. SPEC.md 6.5.
#pragma once

#include <cstdint>
#include <span>

#include "protocol/messages.h"
#include "world_server/scene/needs.h"
#include "world_server/scene/scene.h"

namespace rikiseki::world {

/// `bodies` are those that world.bodies sends for this scene; `revision` counts loads, from 1; `use` is
/// for the needs.
protocol::WorldScene DescribeScene(const Scene& scene, std::span<const protocol::Body> bodies,
                                   std::uint64_t revision, const SceneUse& use = {});

}  // namespace rikiseki::world
