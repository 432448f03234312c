// SPDX-License-Identifier: MIT
// The cases that judge a haptic side, in the order in which they run.
#pragma once

#include <span>

#include "protocol/tools/check/case.h"
#include "protocol/tools/check/world_player.h"

namespace rikiseki::protocol::check {

using HapticCase = Case<WorldPlayer>;

std::span<const HapticCase> HapticSegmentCases();   // header, liveness, ring
std::span<const HapticCase> HapticContactCases();   // what is displayed, and booked
std::span<const HapticCase> HapticLocalCases();     // what can move, and by whom
std::span<const HapticCase> HapticNonsenseCases();  // what is refused
std::span<const HapticCase> HapticEndCases();       // late, silent, dead, restarted
std::span<const HapticCase> HapticMonitorCases();   // judged on every tick of the run

}  // namespace rikiseki::protocol::check
