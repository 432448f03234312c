// SPDX-License-Identifier: MIT
// Both loops, ready to tick: what every experiment that watches them tick by tick starts from.
#pragma once

#include <memory>

#include "haptic_server/device/device.h"
#include "tests/lab/coupled_run.h"

namespace rikiseki::lab {

struct PreparedRun {
  std::unique_ptr<haptic::Device> device;
  std::unique_ptr<CoupledRun> loops;  // its next tick is the first of the script
  double duration_s = 0;              // of the script
};

}  // namespace rikiseki::lab
