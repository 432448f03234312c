// SPDX-License-Identifier: MIT
// Guided procedures tick on the 1 kHz path like everything else: nothing is allocated, nothing locked.
#include <catch2/catch.hpp>

#include "haptic_server/device/simulated_board.h"
#include "haptic_server/device/spidar.h"
#include "haptic_server/guided/calibration_task.h"
#include "haptic_server/guided/identification_task.h"
#include "haptic_server/guided/simulated_hands.h"
#include "haptic_server/guided/stiffness_ramp.h"
#include "tests/haptic_server/guard.h"
#include "tests/haptic_server/guided/guided_drive.h"

namespace rikiseki::haptic {
namespace {

Settings Shipped() {
  return LoadSettings(RIKISEKI_SOURCE_DIR "/config/haptic_server.ini", {});
}

void RunsQuietly(GuidedTask& task) {
  const long allocations = test::Allocations();
  const long locks = test::Locks();
  const int ticks = Drive(task, 120);
  CHECK(test::Allocations() == allocations);
  CHECK(test::Locks() == locks);
  CHECK(ticks < 120'000);
  CHECK_FALSE(task.Result().text.empty());
}

TEST_CASE("calibration allocates nothing and locks nothing while it ticks") {
  const Settings settings = Shipped();
  SimulatedBoard board(settings.spidar, LeadingHand(settings));
  CalibrationTask task(settings, board);
  RunsQuietly(task);
}

TEST_CASE(
    "identification and the stiffness ramp allocate nothing and lock nothing while they tick") {
  const Settings settings = Shipped();
  Spidar device(settings.spidar,
                std::make_unique<SimulatedBoard>(settings.spidar, AbsentHand(settings)));
  IdentificationTask identification(settings, device);
  RunsQuietly(identification);
  Spidar again(settings.spidar,
               std::make_unique<SimulatedBoard>(settings.spidar, AbsentHand(settings)));
  StiffnessRamp ramp(settings, again);
  RunsQuietly(ramp);
}

}  // namespace
}  // namespace rikiseki::haptic
