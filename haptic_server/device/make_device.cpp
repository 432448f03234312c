// SPDX-License-Identifier: MIT
#include "haptic_server/device/make_device.h"

#include <stdexcept>
#include <utility>

#include "common/exit_code.h"
#include "haptic_server/device/simulated_board.h"
#include "haptic_server/device/spidar.h"
#include "haptic_server/device/spidar_grip.h"

namespace rikiseki::haptic {

std::unique_ptr<Device> MakeSpidar(const SpidarSettings& settings,
                                   std::unique_ptr<MotorBoard> board) {
  if (settings.motors_m.size() == kGripStrings) {
    return std::make_unique<SpidarGrip>(settings, std::move(board));
  }
  return std::make_unique<Spidar>(settings, std::move(board));
}

std::unique_ptr<Device> MakeDevice(const Settings& settings) {
  try {
    return MakeSpidar(settings.spidar,
                      std::make_unique<SimulatedBoard>(settings.spidar, MakeHand(settings)));
  } catch (const std::invalid_argument& error) {
    throw StartError(kExitConfig, error.what());
  }
}

}  // namespace rikiseki::haptic
