// SPDX-License-Identifier: MIT
// The tick allocates nothing and locks nothing, and the guard that counts both would notice.
#include <catch2/catch.hpp>
#include <cstdlib>
#include <mutex>

#include "haptic_server/device/make_device.h"
#include "haptic_server/step.h"
#include "tests/haptic_server/guard.h"

namespace rikiseki::haptic {
namespace {

using test::Allocations;
using test::Locks;

void* volatile sink = nullptr;  // keeps the compiler from leaving an allocation out

TEST_CASE("the guard notices new, malloc and a mutex") {
  long before = Allocations();
  sink = new int(1);
  REQUIRE(Allocations() > before);
  delete static_cast<int*>(sink);
  before = Allocations();
  sink = std::malloc(8);
  const long after = Allocations();
  std::free(sink);
  REQUIRE(after == before + 1);
  const long locks_before = Locks();
  std::mutex mutex;
  mutex.lock();
  mutex.unlock();
  const long locks_after = Locks();
  REQUIRE(locks_after == locks_before + 1);
}

TEST_CASE("a tick on the simulated SPIDAR allocates nothing and locks nothing") {
  Settings settings;
  settings.spidar.motors_m = {Vec3(-0.265, 0.265, 0.265), Vec3(0.265, 0.265, -0.265),
                              Vec3(-0.265, -0.265, -0.265), Vec3(0.265, -0.265, 0.265)};
  settings.safety.passivity_controller = true;
  settings.mapping.rotation_deg = Vec3(0, 0, 5);
  const auto device = MakeDevice(settings);
  HapticStep step(settings, *device, 1);
  protocol::HapticTick message;
  protocol::WorldFrame frame;
  frame.period_ns = 50'000'000;
  frame.plane_count = 32;
  for (std::uint32_t i = 0; i < 32; ++i) {
    protocol::Plane& plane = frame.planes[i];
    plane.body = i % 5;
    plane.feature = i;
    plane.point = {0.02 + 0.001 * i, 0, 0};
    plane.normal = {-1, 0.02 * i - 0.3, 0.01 * i};
    plane.velocity = {0, 0.1, 0};
    plane.static_friction = plane.dynamic_friction = 0.1 * (i % 3);
  }
  frame.local_body_count = 4;  // in contact with a floor and with each other
  frame.local_substep_ns = 1'000'000;
  for (std::uint32_t i = 0; i < 4; ++i) {
    protocol::LocalBody& local = frame.local_bodies[i];
    local.body = i;
    local.mass = i == 0 ? 1e-4 : 0.5;  // the first is too light for an explicit step
    local.inertia = {local.mass * 1e-3, 0, 0, local.mass * 2e-3, 0, local.mass * 1e-3};
    local.position = {0.05 + 0.06 * i, 0, 0};
    local.velocity = {0.01, 0, 0};
    local.contact_count = 16;
    for (std::uint32_t j = 0; j < 16; ++j) {
      protocol::ContactPlane& contact = local.contacts[j];
      contact.other_body = j < 12 ? 100 : (i + 1) % 4;
      contact.point = {j % 2 == 0 ? 0.03 : -0.03, j % 4 < 2 ? 0.03 : -0.03, -0.03};
      contact.normal = {0, 0, 1};
      contact.friction = 0.3;
    }
  }
  bool touched = false;
  long allocated = 0;
  long locked = 0;
  for (int k = 0; k < 6000; ++k) {
    WorldInput world{.epoch = k < 4000 ? 9U : 10U, .ready = k % 3000 < 2900};
    TickTime time{.start_ns = std::int64_t{k} * 1'000'000,
                  .previous_duration_ns = k == 0 ? 0 : 1'000'000,
                  .missed = k % 700 == 0 ? 30 : 0};
    world.heartbeat_ns = time.start_ns;
    if (k % 50 == 0) {
      frame.frame = static_cast<std::uint64_t>(k + 1);
      frame.plane_count = k % 1000 == 0 ? 20 : 32;  // some vanish, perhaps pressed
      frame.acked_epoch = 1;
      frame.acked_tick = static_cast<std::uint64_t>(k > 10 ? k - 10 : 0);
      world.frame = &frame;
    }
    const long allocations_before = Allocations();
    const long locks_before = Locks();
    const OperatorInput wish{
        .stop = k % 2500 == 2400, .enable = k % 2500 == 2450, .clutch = k % 1500 > 1450};
    step.Tick(time, world, message, wish);
    allocated += Allocations() - allocations_before;
    locked += Locks() - locks_before;
    touched = touched || message.pointers[0].reason == protocol::ForceReason::kContact;
  }
  const long allocations_before = Allocations();
  step.Stop(static_cast<std::int64_t>(message.start_ns) + 1'000'000, message);
  allocated += Allocations() - allocations_before;
  REQUIRE(touched);
  REQUIRE(allocated == 0);
  REQUIRE(locked == 0);
}

}  // namespace
}  // namespace rikiseki::haptic
