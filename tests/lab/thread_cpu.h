// SPDX-License-Identifier: MIT
// How long this thread has worked, whatever else the computer does. For studies of cost alone: no
// result may depend on it.
#pragma once

#include <ctime>

namespace rikiseki::lab {

/// Seconds on a core since the thread began.
inline double ThreadCpu() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

}  // namespace rikiseki::lab
