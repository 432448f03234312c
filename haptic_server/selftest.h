// SPDX-License-Identifier: MIT
// haptic_server --selftest: whether this PC holds the loop, in words, from what the loop measured of
// itself, and what to change where it does not.
#pragma once

#include <string>
#include <vector>

#include "protocol/messages.h"

namespace rikiseki::haptic {

enum class Hold {
  kWell,    // p99.9 below 50 us, none later than 200 us, no deadline missed: as on PREEMPT_RT
  kEnough,  // p99.9 below 200 us, at most one missed in a minute, never three in a row
  kNot,
};

/// What a run of this length says of the PC. `health` as the loop left it.
Hold Judge(const protocol::HapticHealth& health, double seconds);

/// The verdict, the histogram of the lateness, and what to change. `refusals`: why less than asked for
/// was obtained; empty ones are nothing.
std::string SelftestReport(const protocol::HapticHealth& health, double seconds,
                           const std::vector<std::string>& refusals);

}  // namespace rikiseki::haptic
