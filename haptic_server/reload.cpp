// SPDX-License-Identifier: MIT
#include "haptic_server/reload.h"

#include <spdlog/spdlog.h>

#include "haptic_server/safety/stability.h"

namespace rikiseki::haptic {

void Reload::Again(HapticLoop& loop) {
  ConfigValues read;
  Settings settings;
  try {
    settings = LoadSettings(path_, set_, nullptr, &read);
  } catch (const std::exception& error) {
    spdlog::error("the settings stay as they were: {}", error.what());
    return;
  }
  if (!live_.Compare(read).now.empty() && !loop.Tune(TuningOf(settings))) {
    spdlog::error("the settings stay as they were: the loop has not taken those before");
    return;
  }
  live_.Adopt(read);
  for (const std::string& warning : DeviceWarnings(settings)) {
    spdlog::warn("stability: {}", warning);
  }
}

}  // namespace rikiseki::haptic
