// SPDX-License-Identifier: MIT
// Where the step's impulses go and what energy it sees: damping, friction, fades, an unstable contact.
#include <catch2/catch.hpp>
#include <cmath>

#include "haptic_server/device/hand.h"
#include "tests/haptic_server/step_bench.h"

namespace rikiseki::haptic {
namespace {

using protocol::ForceReason;
using protocol::ImpulseUnits;

TEST_CASE("light damping goes to the ground, and is over when the fade is") {
  Settings settings;
  settings.safety.soft_start_ms = 0;
  settings.safety.light_damping_ns_per_m = 2;
  Bench bench(settings);
  PressOn(bench);
  const ImpulseUnits ground_before = bench.message.ground.impulse;
  REQUIRE(ground_before == ImpulseUnits{});
  bench.world.ready = false;
  double damped = 0;  // N s
  for (int k = 1; k < 80; ++k) {
    bench.device.next.position.y() += 0.0005;  // along the wall
    bench.device.next.velocity = Vec3(0, 0.5, 0);
    bench.Tick();
    const double left = 1 - k / 80.0;
    REQUIRE((bench.device.force - left * Vec3(-4, -2 * 0.5, 0)).norm() < 1e-6);
    damped += left * 2 * 0.5 * 1e-3;
  }
  REQUIRE(bench.message.ground.impulse[1] == Approx(damped * 1e12).epsilon(1e-6));
  REQUIRE(std::abs(bench.message.ground.impulse[0]) < 1'000'000);
  for (int k = 0; k < 4; ++k) bench.Tick();
  REQUIRE(bench.device.force.isZero(0));
  REQUIRE(bench.Tick().isZero(0));  // however long it goes on moving
  REQUIRE(bench.message.pointers[0].reason == ForceReason::kWorldAbsent);

  // Too fast and without a world: nothing either.
  bench.device.next.velocity = Vec3(0, 50, 0);
  REQUIRE(bench.Tick().isZero(0));
}

TEST_CASE("a surface that vanishes under the finger fades out, in the time that it asked for") {
  Settings settings;
  settings.safety.soft_start_ms = 0;
  settings.render.damping_ns_per_m = 0;
  Bench bench(settings);
  bench.planes[0].recovery_s = 0.2;
  PressOn(bench);
  bench.planes.clear();
  bench.ticks_run = 0;
  for (int k = 0; k < 200; ++k) {
    const Vec3 force = bench.Run(1);
    REQUIRE((force - (1 - k / 200.0) * Vec3(-4, 0, 0)).norm() < 1e-9);
    REQUIRE(bench.message.channels[0].state == protocol::ChannelState::kOpen);
  }
  REQUIRE(bench.Run(1).isZero(0));
  REQUIRE(bench.message.pointers[0].reason == ForceReason::kNoContact);
  REQUIRE(bench.message.channels[0].state == protocol::ChannelState::kClosed);
}

TEST_CASE("friction is part of the body's share: nothing of it goes to the ground") {
  Settings settings;
  settings.safety.soft_start_ms = 0;
  Bench bench(settings);
  bench.planes[0].dynamic_friction = bench.planes[0].static_friction = 0.5;
  PressOn(bench);
  const ImpulseUnits before = bench.message.channels[0].impulse;
  for (int k = 0; k < 200; ++k) {
    bench.device.next.position.y() += 1e-4;
    bench.Run(1);
  }
  REQUIRE((ToVec3(bench.message.pointers[0].force) - Vec3(-4, -2, 0)).norm() < 1e-6);
  REQUIRE(bench.message.ground.impulse == ImpulseUnits{});
  // 2 N along +y on the wall, but for the first 2 mm of stick.
  const double dragged =
      1e-12 * static_cast<double>(bench.message.channels[0].impulse[1] - before[1]);
  REQUIRE(dragged == Approx(2 * 0.18 + 0.02).epsilon(0.02));
}

// A bare SPIDAR of 0.03 kg, drawn to the wall by 1 N.
struct BareDevice {
  explicit BareDevice(Bench& used) : bench(used), step(ExactStep({0.03, 0.2, 0}, 1e-3)) {
    bench.device.next.position = Vec3(x, 0, 0);
  }
  void Run(int ticks) {
    for (int k = 0; k < ticks; ++k) {
      bench.Run(1);
      displayed += bench.device.force.x() * 1e-3;
      braked = braked || bench.message.pointers[0].reason == ForceReason::kPassivity;
      const double force = bench.device.force.x() + 1;
      x += step.yv * v + step.yf * force;
      v = step.vv * v + step.vf * force;
      bench.device.next.position.x() = x;
      bench.device.next.velocity.x() = v;
    }
  }
  Bench& bench;
  ImpedanceStep step;
  double x = -0.012, v = 0.1;
  double displayed = 0;  // N s, on the device
  bool braked = false;
};

TEST_CASE(
    "an unstable contact is flagged in health, and the controller keeps it stable and says so") {
  Settings settings;
  settings.safety.soft_start_ms = 0;
  settings.render.stiffness_n_per_m = 4000;  // ten times what the device bears without damping
  settings.render.damping_ns_per_m = 0;
  SECTION("unstable") {
    Bench bench(settings);
    bench.Run(300);
    BareDevice device(bench);
    device.Run(3000);
    CHECK(bench.step.health().energy.flagged > 0);
    CHECK(bench.step.health().energy.injected > 1e-3);
    CHECK(bench.step.health().energy.dissipated > 0);
    CHECK_FALSE(device.braked);
  }
  SECTION("damped as the rule says") {
    settings.render.damping_ns_per_m = 4;
    Bench bench(settings);
    bench.Run(300);
    BareDevice device(bench);
    device.Run(3000);
    CHECK(bench.step.health().energy.flagged == 0);
    CHECK(device.x == Approx(-0.01 + 1 / 4000.0).margin(1e-5));
  }
  SECTION("braked") {
    settings.safety.passivity_controller = true;
    Bench bench(settings);
    bench.Run(300);
    BareDevice device(bench);
    device.Run(3000);
    CHECK(bench.step.health().energy.flagged == 0);
    CHECK(device.braked);
    CHECK(device.x == Approx(-0.01 + 1 / 4000.0).margin(1e-4));
    CHECK(bench.message.ground.impulse[0] != 0);
    // Every unit of the displayed force is booked: to the wall or to the ground.
    const double booked =
        static_cast<double>(bench.message.ground.impulse[0] + bench.message.channels[0].impulse[0]);
    CHECK(booked == Approx(-1e12 * device.displayed).epsilon(1e-9));
  }
}

TEST_CASE("a body that carries the hand along gives energy by right: nothing is injected") {
  Settings settings;
  settings.safety.soft_start_ms = 0;
  settings.render.damping_ns_per_m = 0;
  Bench bench(settings);
  PressOn(bench);
  const double before = bench.step.health().energy.injected;
  // Frame by frame the wall moves by 5 mm; shown interpolated, the finger moves with it.
  const Vec3 finger = bench.device.next.position;
  bench.ticks_run = 0;
  double moved = 0;
  for (int k = 0; k < 1000; ++k) {
    if (k % 50 == 0) bench.planes[0].point = {-0.005 * (1 + k / 50), 0, 0};
    bench.device.next.position = finger - Vec3(1e-4 * k, 0, 0);
    bench.device.next.velocity.x() = -0.1;
    const Vec3 force = bench.Run(1);
    REQUIRE(force.x() == Approx(-4).epsilon(1e-6));
    moved = 1e-4 * k;
  }
  REQUIRE(4 * moved > 0.39);  // J that the wall gave
  REQUIRE(std::abs(bench.step.health().energy.injected - before) < 1e-6);
}

}  // namespace
}  // namespace rikiseki::haptic
