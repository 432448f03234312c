// SPDX-License-Identifier: MIT
// The cases that judge a world side, in the order in which they run.
#pragma once

#include <span>

#include "protocol/tools/check/case.h"
#include "protocol/tools/check/haptic_player.h"

namespace rikiseki::protocol::check {

using WorldCase = Case<HapticPlayer>;

std::span<const WorldCase> WorldSegmentCases();   // header, liveness, ring
std::span<const WorldCase> WorldContactCases();   // planes, acks, what is applied
std::span<const WorldCase> WorldLocalCases();     // what can move, and by whom
std::span<const WorldCase> WorldNonsenseCases();  // what is refused
std::span<const WorldCase> WorldEndCases();       // silent, dead, restarted haptic sides
std::span<const WorldCase> WorldMonitorCases();   // judged on every frame of the run

}  // namespace rikiseki::protocol::check
