// SPDX-License-Identifier: MIT
// Log lines of a daemon: through spdlog to stderr, or to the journal where that is what stderr leads to,
// with their levels. Never from a real-time tick: spdlog formats, allocates and locks in its caller.
#pragma once

#include <string>

namespace rikiseki {

/// "2026-01-31 12:00:00.000 haptic_server info: ..."; once, before any thread logs.
void StartLogging(const std::string& program);

}  // namespace rikiseki
