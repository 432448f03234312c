// SPDX-License-Identifier: MIT
// Reads the recording that the settings name and makes a device of it.
#pragma once

#include <memory>

#include "haptic_server/device/device.h"
#include "haptic_server/settings.h"

namespace rikiseki::haptic {

/// Of device.file, with the first finger's positions put back from the world to the device by
/// [mapping]. Throws StartError (78) if it is no recording, or holds no tick.
std::unique_ptr<Device> OpenReplay(const Settings& settings);

}  // namespace rikiseki::haptic
