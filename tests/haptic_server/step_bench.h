// SPDX-License-Identifier: MIT
// What the tests of the step share: one with its device, its clock, and the frames of a world.
#pragma once

#include <catch2/catch.hpp>
#include <cstdint>
#include <vector>

#include "haptic_server/step.h"
#include "tests/haptic_server/test_device.h"

namespace rikiseki::haptic {

inline constexpr std::int64_t kPeriodNs = 1'000'000;
inline constexpr std::uint64_t kOwnEpoch = 4242;

inline protocol::Plane WallFacing(const Vec3& point, const Vec3& normal, std::uint32_t body = 1) {
  protocol::Plane plane;
  plane.body = body;
  plane.point = ToArray(point);
  plane.normal = ToArray(normal);
  return plane;
}

// A step, its device, its clock, and the frames that a world of 20 Hz hands over.
struct Bench {
  explicit Bench(const Settings& used = Settings{}, std::uint64_t own_epoch = kOwnEpoch)
      : settings(used), step(used, device, own_epoch) {
    planes = {WallFacing(Vec3::Zero(), -Vec3::UnitX())};
    device.next.position = Vec3(-0.05, 0, 0);
  }

  protocol::WorldFrame& NextFrame() {
    frame = {};
    frame.frame = ++frame_number;
    frame.period_ns = 50'000'000;
    for (const protocol::Plane& plane : planes) frame.planes[frame.plane_count++] = plane;
    return frame;
  }

  // One tick; `hand_over` what the world published since.
  Vec3 Tick(const protocol::WorldFrame* hand_over = nullptr, std::int64_t duration = kPeriodNs,
            std::int64_t missed = 0) {
    TickTime time{.start_ns = now_ns, .previous_duration_ns = previous_ns, .missed = missed};
    if (beats) world.heartbeat_ns = now_ns;
    world.frame = hand_over;
    step.Tick(time, world, message, wish);
    previous_ns = duration;
    now_ns += duration;
    return ToVec3(message.pointers[0].force);
  }

  // Ticks with a frame each 50.
  Vec3 Run(int ticks) {
    Vec3 force = Vec3::Zero();
    for (int i = 0; i < ticks; ++i) force = Tick(ticks_run++ % 50 == 0 ? &NextFrame() : nullptr);
    return force;
  }

  Settings settings;
  TestDevice device;
  HapticStep step;
  WorldInput world{.epoch = 9, .ready = true};
  OperatorInput wish;
  bool beats = true;
  std::int64_t now_ns = 1'000'000'000;
  std::int64_t previous_ns = 0;
  std::vector<protocol::Plane> planes;
  std::uint64_t frame_number = 0;
  int ticks_run = 0;
  protocol::WorldFrame frame;
  protocol::HapticTick message;
};

// 42 mm at 0.7 m/s, an approach and no surprise: into the wall, to where it bears 4 N.
inline void PushIn(Bench& bench) {
  for (int i = 0; i < 60; ++i) {
    bench.device.next.position.x() += 0.0007;
    bench.device.next.velocity.x() = 0.7;
    bench.Run(1);
  }
  bench.device.next.velocity.setZero();
}

// In contact with 4 N.
inline void PressOn(Bench& bench) {
  bench.Run(300);
  PushIn(bench);
  REQUIRE(bench.Run(40).norm() == Approx(4).epsilon(1e-6));
}

}  // namespace rikiseki::haptic
