// SPDX-License-Identifier: MIT
// Frames that a haptic side must leave alone, and how the kit sees that it does.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "protocol/tools/check/world_player.h"

namespace rikiseki::protocol::check {

using Words = std::vector<std::uint64_t>;
using Spoil = std::function<void(Words&, Encoded&)>;

/// Three spoilt frames among good ones: none is displayed, the good ones are, the surface stays. Their
/// stamps are `stamp_offset_ns` later than now.
void Refuses(WorldPlayer& player, const Spoil& spoil, std::int64_t stamp_offset_ns = 0);

/// The same with frames that are encoded as they are, after `amend` made nonsense of them.
void RefusesFrame(WorldPlayer& player, const std::function<void(WorldFrame&)>& amend);

}  // namespace rikiseki::protocol::check
