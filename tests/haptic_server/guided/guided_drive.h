// SPDX-License-Identifier: MIT
// Drives a guided procedure in virtual time.
#pragma once

#include "haptic_server/guided/guided_task.h"

namespace rikiseki::haptic {

/// Ticks until the procedure ends or `seconds` are over; how many there were.
inline int Drive(GuidedTask& task, double seconds, std::int64_t period_ns = 1'000'000) {
  TickTime time{.start_ns = 1'000'000'000};
  int ticks = 0;
  while (1e-9 * static_cast<double>(ticks * period_ns) < seconds) {
    ++ticks;
    if (!task.Tick(time, {})) break;
    time.start_ns += period_ns;
    time.previous_duration_ns = period_ns;
  }
  return ticks;
}

}  // namespace rikiseki::haptic
