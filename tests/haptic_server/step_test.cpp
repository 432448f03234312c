// SPDX-License-Identifier: MIT
#include "haptic_server/step.h"

#include <catch2/catch.hpp>
#include <random>

#include "tests/haptic_server/step_bench.h"

namespace rikiseki::haptic {
namespace {

using protocol::ForceReason;
using protocol::PeerState;

TEST_CASE("a finger in a wall feels k times the depth of its sphere, and the message says so") {
  Bench bench;
  bench.Run(400);
  REQUIRE(bench.message.pointers[0].reason == ForceReason::kNoContact);
  REQUIRE(bench.step.health().peer_state == PeerState::kLive);
  PushIn(bench);
  const Vec3 force = bench.Run(20);
  const double depth = bench.device.next.position.x() + 0.01;
  REQUIRE(depth == Approx(0.002));
  REQUIRE((force - Vec3(-2000 * depth, 0, 0)).norm() < 1e-9);

  const protocol::HapticTick& message = bench.message;
  REQUIRE(message.tick == 479);
  REQUIRE(message.start_ns == 1'479'000'000);
  REQUIRE(message.period_ns == 1'000'000);
  REQUIRE(message.previous_duration_ns == 1'000'000);
  REQUIRE(message.world_epoch == 9);
  REQUIRE(message.world_frame == 10);
  REQUIRE(message.stiffness == 2000);
  REQUIRE(message.damping == 2);
  REQUIRE(message.force_cap == 10);
  REQUIRE(message.pointer_count == 1);
  REQUIRE(message.pointers[0].reason == ForceReason::kContact);
  REQUIRE(message.pointers[0].radius == 0.01);
  REQUIRE(ToVec3(message.pointers[0].position) == bench.device.next.position);
  REQUIRE(message.channel_count == 1);
  REQUIRE(message.channels[0].body == 1);
  REQUIRE(message.channels[0].impulse[0] > 0);
  // It acts on the wall's surface: at D - r n, where D is one radius in front of it.
  REQUIRE(ToVec3(message.channels[0].contact_point).norm() < 1e-12);
  REQUIRE(std::string(bench.step.health().device.data()) == "test device");
}

TEST_CASE("whatever ends a world, the force fades to zero within the stated bound") {
  Settings settings;
  settings.safety.soft_start_ms = 0;
  Bench bench(settings);
  bench.Run(200);
  PushIn(bench);
  const double before = bench.Run(90).norm();
  REQUIRE(before == Approx(4).epsilon(1e-6));
  bench.Tick(&bench.NextFrame());
  const std::int64_t last_frame_ns = bench.now_ns - kPeriodNs;

  bool at_once = false;
  SECTION("silence") {}
  SECTION("no heartbeat") {
    bench.beats = false;
  }
  SECTION("closed") {
    bench.world.ready = false;
    at_once = true;
  }
  SECTION("gone") {
    bench.world = {};
    at_once = true;
  }
  SECTION("replaced") {
    bench.world.epoch = 10;
    at_once = true;
  }
  const auto bound = static_cast<std::int64_t>(bench.step.health().zero_force_after_ns);
  REQUIRE(bound == 335'000'000);
  Vec3 last = bench.device.force;
  while (!bench.device.force.isZero(0)) {
    bench.Tick();
    REQUIRE((bench.device.force - last).norm() <= 5);
    last = bench.device.force;
    REQUIRE(bench.now_ns - kPeriodNs - last_frame_ns <= bound);
    if (at_once) REQUIRE(bench.now_ns - last_frame_ns <= 90'000'000);
  }
  REQUIRE(bench.message.pointers[0].reason == ForceReason::kWorldLost);
  for (int i = 0; i < 3; ++i) bench.Tick();
  if (at_once) REQUIRE(bench.message.channels[0].state == protocol::ChannelState::kClosed);
  for (int i = 0; i < 100; ++i) {
    bench.Tick();
    REQUIRE(bench.device.force.isZero(0));
  }
  REQUIRE(bench.message.pointers[0].reason == ForceReason::kWorldAbsent);
}

TEST_CASE(
    "a loop that stalls, a device that fails and a finger too fast feel nothing, then softly "
    "again") {
  Bench bench;
  bench.Run(300);
  PushIn(bench);
  bench.Run(20);
  REQUIRE(bench.device.force.norm() == Approx(4).epsilon(1e-6));
  ForceReason reason = ForceReason::kContact;
  SECTION("stall") {
    bench.Tick(nullptr, 21 * kPeriodNs);
    bench.Tick(nullptr, kPeriodNs, 20);
    reason = ForceReason::kLoopFault;
  }
  SECTION("device") {
    bench.device.status = DeviceStatus::kFault;
    bench.Tick();
    reason = ForceReason::kDeviceFault;
  }
  SECTION("speed") {
    bench.device.next.velocity = Vec3(0, 1e6, 0);
    bench.Tick();
    reason = ForceReason::kOverSpeed;
  }
  SECTION("nonsense") {
    bench.device.next.position.y() = std::nan("");
    bench.Tick();
    reason = ForceReason::kNotFinite;
    REQUIRE(bench.message.pointers[0].position[1] == 0);  // the last sound one
  }
  REQUIRE(bench.message.pointers[0].reason == reason);
  // A finger that is too fast is damped: 1 N s/m, at most as for the speed limit of 3 m/s.
  const Vec3 damping = reason == ForceReason::kOverSpeed ? Vec3(0, -3, 0) : Vec3(0, 0, 0);
  REQUIRE((bench.device.force - damping).norm() < 1e-9);
  REQUIRE(bench.step.health().reason == reason);
  bench.device.status = DeviceStatus::kOk;
  bench.device.next.velocity.setZero();
  bench.device.next.position.y() = 0;
  bench.Run(2);
  REQUIRE(bench.message.pointers[0].reason == ForceReason::kSoftStart);
  REQUIRE(bench.device.force.norm() < 0.1);
  REQUIRE(bench.Run(400).norm() == Approx(4).epsilon(1e-6));
}

TEST_CASE("Stop lets go and says so, and the books take no more") {
  Bench bench;
  bench.Run(400);
  const std::uint64_t tick = bench.message.tick;
  // The loop was told 0.3 ms after its last tick: so long was the last force held.
  const std::int64_t last_start_ns = bench.now_ns - bench.previous_ns;
  bench.step.Stop(last_start_ns + 300'000, bench.message);
  REQUIRE(bench.device.released);
  REQUIRE(bench.message.start_ns == static_cast<std::uint64_t>(last_start_ns + 300'000));
  REQUIRE(bench.message.previous_duration_ns == 300'000);
  REQUIRE(bench.message.tick == tick + 1);
  REQUIRE(bench.message.pointers[0].reason == ForceReason::kStopped);
  REQUIRE(ToVec3(bench.message.pointers[0].force).isZero(0));
  REQUIRE(bench.step.health().reason == ForceReason::kStopped);
}

TEST_CASE("a contact without a channel displays no force") {
  Settings settings;
  settings.safety.soft_start_ms = 0;
  Bench bench(settings);
  bench.Run(200);
  std::uint32_t body = 1;
  bool refused = false;
  // Each frame brings another body at the finger, and this world never acknowledges anything.
  bench.device.next.position.x() = -0.0099;
  for (; body < 40 && !refused; ++body) {
    bench.planes = {WallFacing(Vec3::Zero(), -Vec3::UnitX(), body)};
    bench.Tick(&bench.NextFrame());
    for (int i = 0; i < 120; ++i) bench.Tick();  // recovery passes
    refused = bench.message.pointers[0].reason == ForceReason::kNoChannel;
    REQUIRE(bench.device.force.isZero(0) == refused);
  }
  REQUIRE(body - 1 == protocol::kMaxChannels + 1);
  REQUIRE(bench.message.channel_count == protocol::kMaxChannels);
  // A new world starts with all of them.
  bench.world.epoch = 10;
  bench.frame_number = 0;
  for (int i = 0; i < 200; ++i) bench.Tick();
  bench.ticks_run = 0;
  bench.planes = {WallFacing(Vec3::Zero(), -Vec3::UnitX(), 1)};
  REQUIRE(bench.Run(400).norm() > 0.1);
  REQUIRE(bench.message.channel_count == 1);
  REQUIRE(bench.message.world_epoch == 10);
}

TEST_CASE("hostile frames, samples and worlds: finite, capped, slew-limited, zero in time") {
  for (const std::uint64_t seed : {11U, 12U, 13U, 14U}) {
    std::mt19937_64 random(seed);
    const auto chance = [&](unsigned permille) { return random() % 1000 < permille; };
    const double wild[] = {
        0,       1e-310, -5e-324, 1e-3, -0.01, 1, 1e6, 1e12, -1.7976931348623157e308, std::nan(""),
        INFINITY};
    const auto value = [&] {
      return chance(50) ? wild[random() % std::size(wild)]
                        : 0.04 * (static_cast<double>(random() >> 11) * 0x1p-53 - 0.5);
    };
    const auto word = [&] { return chance(100) ? random() : random() % 8; };
    Settings settings;
    settings.render.adhesion = seed % 2 == 0;
    settings.render.display = static_cast<DisplayRule>(seed % 3);
    Bench bench(settings);
    Vec3 before = Vec3::Zero();
    std::int64_t frame_ns = bench.now_ns;
    int felt = 0;
    bool alive = true;
    for (int k = 0; k < 60'000; ++k) {
      protocol::WorldFrame* frame = nullptr;
      if (random() % 2000 == 0) alive = !alive;
      if (alive && (k % 20 == 0 || chance(5))) {
        frame = &bench.NextFrame();
        frame->period_ns = chance(20) ? random() : 20'000'000;
        frame->plane_count = chance(10) ? static_cast<std::uint32_t>(random())
                                        : static_cast<std::uint32_t>(random() % 33);
        frame->acked_epoch = chance(800) ? kOwnEpoch : word();
        frame->acked_tick = chance(500) ? static_cast<std::uint64_t>(k) - random() % 50 : word();
        frame->baseline_tick = word();
        for (auto* units : {&frame->applied, &frame->discarded}) {
          for (std::int64_t& unit : *units) unit = static_cast<std::int64_t>(random());
        }
        for (protocol::Plane& plane : frame->planes) {
          plane.pointer = chance(20) ? static_cast<std::uint32_t>(random()) : 0;
          plane.body = static_cast<std::uint32_t>(word());
          plane.feature = static_cast<std::uint32_t>(random() % 4);
          plane.point = {value(), value(), value()};
          plane.normal = {value(), value(), value()};
          plane.stiffness = chance(200) ? value() * 1e6 : 0;
          plane.damping = chance(200) ? value() * 1e3 : 0;
        }
        frame_ns = bench.now_ns;
        if (chance(3)) frame->frame = random();
      }
      if (random() % 3000 == 0) {
        bench.world.epoch = word();
        bench.frame_number = 0;
      }
      bench.beats = alive;
      bench.world.ready = alive || chance(900);
      bench.device.status = chance(2) ? DeviceStatus::kFault : DeviceStatus::kOk;
      bench.device.next.position = Vec3(value(), value(), value());
      bench.device.next.velocity = chance(10) ? Vec3(value(), value(), value()) : Vec3(0.1, 0, 0);
      if (!chance(100)) bench.device.next.position = Vec3(0.001, 0.002, 0);
      const std::int64_t missed = chance(3) ? static_cast<std::int64_t>(random() % 40) : 0;
      const Vec3 force = bench.Tick(
          frame, kPeriodNs * (1 + missed) + static_cast<std::int64_t>(random() % 400'000) - 200'000,
          missed);
      REQUIRE(force.allFinite());
      REQUIRE(force.norm() <= settings.safety.force_cap_n);
      REQUIRE((force - before).norm() <= settings.safety.slew_limit_n_per_s * 1e-3);
      before = force;
      felt += force.isZero(0) ? 0 : 1;
      const auto bound = static_cast<std::int64_t>(bench.step.health().zero_force_after_ns);
      // This clock jitters by 20 % and skips up to 39 periods at once, which may delay a tick that
      // much.
      if (bench.now_ns - frame_ns > bound + 60 * kPeriodNs) REQUIRE(force.isZero(0));
    }
    const protocol::HapticHealth& health = bench.step.health();
    REQUIRE(felt > 2000);
    REQUIRE(health.largest_force > 1);
    REQUIRE(health.largest_force <= settings.safety.force_cap_n);
    REQUIRE(health.largest_force_step <= health.slew_limit * 1e-3);
  }
}

TEST_CASE("settings that cannot be safe are refused by the step itself") {
  TestDevice device;
  Settings settings;
  settings.safety.fade_ms = 99;
  REQUIRE_THROWS_AS(HapticStep(settings, device, 0), std::invalid_argument);
}

}  // namespace
}  // namespace rikiseki::haptic
