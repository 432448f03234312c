// SPDX-License-Identifier: MIT
// Which bodies the haptic side may move by itself until the next frame, with all they touch or can
// reach before the frame after next. numerics.md section 4; SPEC.md 6.2.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "protocol/messages.h"
#include "world_server/features/planes.h"
#include "world_server/physics/dynamics_world.h"
#include "world_server/scene/scene.h"

namespace rikiseki::world {

/// A neighbour that can move and gets no copy of its own may be a plane with a mass if it is so many
/// times heavier; lighter ones as planes are worse than unknown (+29 to +943 % of displacement).
inline constexpr double kHeavyNeighbour = 10;

/// Who stands on the other side of a joint to the world, on the wire. SPEC.md 6.2.
inline constexpr std::uint32_t kNoBody = 0xffffffff;

/// Fills `local_bodies` with the movable bodies of `planes`, nearest first, and the movable
/// neighbours that they can push, and returns how many. Of more contacts than a copy can have it gets
/// its joints and the nearest. A body whose contacts cannot be told - something bounces, it touches
/// a light neighbour for which there is no room - is left out: it moves by the frames alone.
std::uint32_t FindLocalBodies(const Scene& scene, const DynamicsWorld& dynamics,
                              std::span<const BodyState> states,
                              std::span<const std::uint32_t> generations,
                              std::span<const protocol::Plane> planes, const FeatureReach& reach,
                              std::span<protocol::LocalBody> local_bodies);

}  // namespace rikiseki::world
