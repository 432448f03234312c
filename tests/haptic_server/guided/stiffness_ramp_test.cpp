// SPDX-License-Identifier: MIT
#include "haptic_server/guided/stiffness_ramp.h"

#include <catch2/catch.hpp>

#include "haptic_server/device/simulated_board.h"
#include "haptic_server/device/spidar.h"
#include "haptic_server/guided/simulated_hands.h"
#include "haptic_server/safety/stability.h"
#include "tests/haptic_server/guided/guided_drive.h"

namespace rikiseki::haptic {
namespace {

Settings WithDamping(double damping, double latency_us = 0) {
  Settings settings;
  settings.spidar.motors_m = {Vec3(-0.265, 0.265, 0.265), Vec3(0.265, 0.265, -0.265),
                              Vec3(-0.265, -0.265, -0.265), Vec3(0.265, -0.265, 0.265)};
  settings.spidar.latency_us = latency_us;
  settings.render.damping_ns_per_m = damping;
  return settings;
}

TEST_CASE("the measured Z-width is that of the theory") {
  const auto [damping, latency_us] =
      GENERATE(std::pair(0.0, 0.0), std::pair(1.0, 0.0), std::pair(2.0, 0.0), std::pair(5.0, 0.0),
               std::pair(2.0, 500.0), std::pair(2.0, 1000.0));
  CAPTURE(damping, latency_us);
  const Settings settings = WithDamping(damping, latency_us);
  const double theory = LargestStableStiffness(DeviceAlone(settings), damping);
  CAPTURE(theory);
  REQUIRE(theory > 150);
  auto owned = std::make_unique<SimulatedBoard>(settings.spidar, AbsentHand(settings));
  const SimulatedBoard& board = *owned;
  Spidar device(settings.spidar, std::move(owned));
  StiffnessRamp ramp(settings, device);
  const int ticks = Drive(ramp, 120);
  CHECK(ticks < 120'000);
  INFO(ramp.Result().text);
  CHECK(ramp.stiffness() == Approx(theory).epsilon(0.1));
  CHECK_THAT(ramp.Result().text, Catch::Contains("a limit cycle begins at"));
  if (latency_us > 0) return;
  for (const double tension : board.tension()) CHECK(tension == settings.spidar.tension_min_n);
}

TEST_CASE("a wall that is unstable at once is let go within 0.2 s") {
  // More damping than the mass bears: 2 m/T.
  Settings settings = WithDamping(70);
  REQUIRE(LargestStableStiffness(DeviceAlone(settings), 70) == 0);
  Spidar device(settings.spidar,
                std::make_unique<SimulatedBoard>(settings.spidar, AbsentHand(settings)));
  StiffnessRamp ramp(settings, device);
  const int ticks = Drive(ramp, 20);
  CHECK(ticks < 3000 + 200);  // of which 3 s to settle
  CHECK(ramp.stiffness() == 100);
}

TEST_CASE("a cap that hides a limit cycle is said, not taken for one") {
  Settings settings = WithDamping(5);
  settings.safety.force_cap_n = 0.3;
  Spidar device(settings.spidar,
                std::make_unique<SimulatedBoard>(settings.spidar, AbsentHand(settings)));
  StiffnessRamp ramp(settings, device);
  Drive(ramp, 120);
  CHECK_THAT(ramp.Result().text, Catch::Contains("No limit cycle up to"));
  CHECK(ramp.stiffness() < LargestStableStiffness(DeviceAlone(settings), 5));
}

TEST_CASE("a stop in the middle leaves nothing to report") {
  const Settings settings = WithDamping(2);
  Spidar device(settings.spidar,
                std::make_unique<SimulatedBoard>(settings.spidar, AbsentHand(settings)));
  StiffnessRamp ramp(settings, device);
  CHECK(Drive(ramp, 5) == 5000);
  CHECK_FALSE(
      ramp.Tick({.start_ns = 6'001'000'000, .previous_duration_ns = 1'000'000}, {.stop = true}));
  CHECK_THROWS_AS(ramp.Result(), NothingFound);
}

}  // namespace
}  // namespace rikiseki::haptic
