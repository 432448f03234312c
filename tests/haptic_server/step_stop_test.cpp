// SPDX-License-Identifier: MIT
// The emergency stop, within the step and down to the strings.
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <memory>

#include "haptic_server/device/hand.h"
#include "haptic_server/device/simulated_board.h"
#include "haptic_server/device/spidar.h"
#include "tests/haptic_server/step_bench.h"

namespace rikiseki::haptic {
namespace {

using protocol::ForceReason;

TEST_CASE("the emergency stop takes the force away in its own tick, and keeps it away") {
  Settings settings;
  settings.safety.slew_limit_n_per_s = 1000;  // 1 N a tick: 4 ticks without the stop
  settings.safety.fade_ms = 50;
  Bench bench(settings);
  PressOn(bench);
  bench.device.released = false;
  SECTION("by command") {
    bench.wish.stop = true;
  }
  SECTION("by the device's enable input") {
    bench.device.next.enabled = false;
  }
  SECTION("by the enable input of a device that measures nonsense") {
    bench.device.next.enabled = false;
    bench.device.next.position.y() = std::nan("");
  }
  SECTION("and nobody can enable in the tick of a stop") {
    bench.wish.stop = bench.wish.enable = true;
  }
  REQUIRE(bench.Run(1).isZero(0));
  REQUIRE(bench.device.released);
  REQUIRE(bench.message.pointers[0].reason == ForceReason::kEmergencyStop);
  bench.wish = {};
  bench.device.next.enabled = true;
  bench.device.next.position.y() = 0;
  for (int k = 0; k < 500; ++k) {  // latched, whatever the world does
    REQUIRE(bench.Run(1).isZero(0));
    REQUIRE(bench.message.pointers[0].reason == ForceReason::kEmergencyStop);
  }
  bench.world.ready = false;
  for (int k = 0; k < 200; ++k) REQUIRE(bench.Tick().isZero(0));
  REQUIRE(bench.message.pointers[0].reason == ForceReason::kEmergencyStop);
  bench.world.ready = true;
  bench.ticks_run = 0;
  bench.Run(400);
  REQUIRE(bench.device.force.isZero(0));

  bench.wish.enable = true;
  Vec3 before = Vec3::Zero();
  for (int k = 0; k < 199; ++k) {
    bench.Run(1);
    bench.wish = {};
    REQUIRE(bench.message.pointers[0].reason == ForceReason::kSoftStart);
    REQUIRE((bench.device.force - before).norm() <= (k == 0 ? 0.0401 : 0.0201));
    before = bench.device.force;
  }
  REQUIRE(bench.Run(50).norm() == Approx(4).epsilon(1e-6));
}

TEST_CASE("a device whose enable input is open at the start starts stopped") {
  Bench bench;
  bench.device.next.enabled = false;
  bench.wish.enable = true;  // in vain as long as it is open
  bench.device.next.position.x() = -0.008;
  for (int k = 0; k < 400; ++k) REQUIRE(bench.Run(1).isZero(0));
  bench.wish.enable = false;
  bench.device.next.enabled = true;
  for (int k = 0; k < 100; ++k) REQUIRE(bench.Run(1).isZero(0));
  REQUIRE(bench.message.pointers[0].reason == ForceReason::kEmergencyStop);
  bench.wish.enable = true;
  bench.Run(400);
  REQUIRE(bench.device.force.norm() == Approx(4).epsilon(1e-6));
}

TEST_CASE("an emergency stop leaves every string of a SPIDAR at its minimum tension") {
  Settings settings;
  settings.spidar.motors_m = {Vec3(-0.265, 0.265, 0.265), Vec3(0.265, 0.265, -0.265),
                              Vec3(-0.265, -0.265, -0.265), Vec3(0.265, -0.265, 0.265)};
  settings.hand.script = HandScript::kRest;
  settings.hand.home_mm = Vec3(-8, 5, 3);
  auto owned = std::make_unique<SimulatedBoard>(settings.spidar, MakeHand(settings));
  SimulatedBoard& board = *owned;
  Spidar spidar(settings.spidar, std::move(owned));
  HapticStep step(settings, spidar, kOwnEpoch);
  protocol::WorldFrame frame;
  frame.period_ns = 50'000'000;
  frame.plane_count = 1;
  frame.planes[0] = WallFacing(Vec3::Zero(), -Vec3::UnitX());
  protocol::HapticTick message;
  std::int64_t now_ns = 0;
  const auto run = [&](int ticks) {
    for (int k = 0; k < ticks; ++k, now_ns += kPeriodNs) {
      const bool due = now_ns % 50'000'000 == 0;
      if (due) ++frame.frame;
      step.Tick(
          {.start_ns = now_ns, .previous_duration_ns = now_ns == 0 ? 0 : kPeriodNs},
          {.epoch = 9, .ready = true, .heartbeat_ns = now_ns, .frame = due ? &frame : nullptr},
          message);
    }
  };
  const std::array<double, 4> loose = {0.5, 0.5, 0.5, 0.5};
  run(500);
  REQUIRE(ToVec3(message.pointers[0].force).norm() > 0.5);
  REQUIRE_FALSE(std::ranges::equal(board.tension(), loose));
  board.SetEnabled(false);
  run(1);
  REQUIRE(message.pointers[0].reason == ForceReason::kEmergencyStop);
  REQUIRE(std::ranges::equal(board.tension(), loose));
  board.SetEnabled(true);
  run(100);
  REQUIRE(std::ranges::equal(board.tension(), loose));
}

}  // namespace
}  // namespace rikiseki::haptic
