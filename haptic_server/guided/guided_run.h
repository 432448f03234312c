// SPDX-License-Identifier: MIT
// Guided procedures at the real device, or at the simulated one with a hand that does what is asked: a
// real-time loop, prompts and results on the terminal, values into the device file.
#pragma once

#include <string>

#include "haptic_server/operator_panel.h"
#include "haptic_server/settings.h"

namespace rikiseki::haptic {

enum class Procedure { kCalibrate, kIdentify, kZWidth };

/// Runs it to its end, or until SIGINT or SIGTERM. Returns the exit status. Throws StartError and
/// ConfigError.
int RunGuided(Procedure procedure, const Settings& settings, OperatorPanel& panel);

}  // namespace rikiseki::haptic
