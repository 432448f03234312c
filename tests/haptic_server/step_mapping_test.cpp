// SPDX-License-Identifier: MIT
// The step behind a mapping between device and world.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <map>

#include "haptic_server/device/mapping.h"
#include "tests/haptic_server/step_bench.h"

namespace rikiseki::haptic {
namespace {

using protocol::ForceReason;
using protocol::ImpulseUnits;

// The finger is at `at` in the world, 3 mm deep in a wall on the plane x = 0 whose normal is -x.
struct MappedBench : Bench {
  explicit MappedBench(const Settings& used) : Bench(used), mapping(used.mapping) {
    Place(Vec3(-0.05, 0, 0));
  }
  void Place(const Vec3& at) {
    const MappingSettings& m = settings.mapping;
    const Vec3 turned = (at - m.origin_mm * 1e-3) / m.motion_scale;
    // The inverse of a rotation, by what the mapping says of the axes.
    for (int i = 0; i < 3; ++i) {
      device.next.position[i] = mapping.VelocityInWorld(Vec3::Unit(i)).dot(turned) / m.motion_scale;
    }
  }
  Mapping mapping;
};

Settings Mapped(double motion_scale, double force_scale) {
  Settings settings;
  settings.safety.soft_start_ms = 0;
  settings.render.damping_ns_per_m = 0;
  settings.mapping = {.origin_mm = Vec3(20, -7, 3),
                      .rotation_deg = Vec3(30, 40, -70),
                      .motion_scale = motion_scale,
                      .force_scale = force_scale};
  return settings;
}

TEST_CASE("through the mapping the hand feels s_f s_x k, and the world keeps its own units") {
  const double motion = GENERATE(1.0, 5.0, 0.5);
  const double force = GENERATE(1.0, 0.2, 2.0);
  MappedBench bench(Mapped(motion, force));
  bench.Run(200);
  std::map<std::uint32_t, ImpulseUnits> totals;
  Vec3 impulse = Vec3::Zero();
  for (int k = 1; k <= 60; ++k) {
    bench.Place(Vec3(-0.01 + 2e-5 * k, 0, 0));
    bench.Run(1);
    impulse -= ToVec3(bench.message.pointers[0].force) * 1e-3;
  }
  const protocol::Pointer& pointer = bench.message.pointers[0];
  REQUIRE((ToVec3(pointer.position) - Vec3(-0.0088, 0, 0)).norm() < 1e-12);
  REQUIRE(pointer.radius == 0.01);
  const Vec3 in_world(-2000 * 0.0012, 0, 0);
  REQUIRE((ToVec3(pointer.force) - in_world).norm() < 1e-9);
  // The device got s_f R^T f: s_f s_x k times its own way.
  REQUIRE((bench.mapping.ForceInWorld(bench.device.force) - in_world).norm() < 1e-9);
  REQUIRE(bench.device.force.norm() == Approx(force * 2.4));
  const double depth_at_device = 0.0012 / motion;
  REQUIRE(bench.device.force.norm() / depth_at_device == Approx(force * motion * 2000));
  // Books in world units.
  REQUIRE(bench.message.channels[0].impulse[0] == Approx(impulse.x() * 1e12).epsilon(1e-9));
  REQUIRE(bench.message.force_cap == Approx(10 / force));
  REQUIRE(bench.step.health().slew_limit == Approx(5000 / force));

  // Cap and slew act at the device, whatever the scale.
  bench.Place(Vec3(0.09, 0, 0));
  for (int k = 0; k < 100; ++k) {
    const Vec3 before = bench.device.force;
    bench.Run(1);
    REQUIRE((bench.device.force - before).norm() <= 5);
    REQUIRE(bench.device.force.norm() <= 10);
    REQUIRE(ToVec3(bench.message.pointers[0].force).norm() <=
            bench.message.force_cap * (1 + 1e-14));
  }
  REQUIRE(bench.device.force.norm() == Approx(10));
}

TEST_CASE("books and energy balance at s_x = 5, s_f = 0.2") {
  MappedBench bench(Mapped(5, 0.2));
  bench.settings.render.damping_ns_per_m = 0;
  bench.Run(200);
  // In and out again, quasi-statically: a spring gives back what it took, and what the hand did on
  // the device is s_f/s_x of what it did on the world.
  double work_at_device = 0;
  double work_in_world = 0;
  double largest = 0;
  ImpulseUnits booked{};
  Vec3 impulse = Vec3::Zero();
  Vec3 hand = bench.device.next.position;
  Vec3 finger = ToVec3(bench.message.pointers[0].position);
  const int steps = 4000;
  for (int k = 0; k <= steps; ++k) {
    const double q = std::sin(M_PI * k / steps);
    bench.Place(Vec3(-0.0101 + 0.004 * q, 0.002 * q, 0));
    const Vec3 force_before = bench.device.force;
    const Vec3 world_force_before = ToVec3(bench.message.pointers[0].force);
    bench.Run(1);
    work_at_device += force_before.dot(bench.device.next.position - hand);
    work_in_world += world_force_before.dot(ToVec3(bench.message.pointers[0].position) - finger);
    hand = bench.device.next.position;
    finger = ToVec3(bench.message.pointers[0].position);
    impulse -= ToVec3(bench.message.pointers[0].force) * 1e-3;
    largest = std::max(largest, bench.device.force.norm());
    booked = bench.message.channels[0].impulse;
  }
  REQUIRE(largest == Approx(0.2 * 2000 * 0.0039).epsilon(1e-3));
  REQUIRE(work_at_device == Approx(work_in_world * 0.2 / 5).epsilon(1e-9));
  // The zero-order hold leaks k/2 sum (dx)^2 = k/2 pi^2/2 a^2/steps of the way a at the device.
  const double stored = 0.2 * 5 * 2000 / 2 * 0.0008 * 0.0008;
  REQUIRE(std::abs(work_at_device) < 0.01 * stored);
  for (int i = 0; i < 3; ++i) {
    REQUIRE(static_cast<double>(booked[static_cast<std::size_t>(i)]) * 1e-12 ==
            Approx(impulse[i]).margin(1e-9));
  }
  REQUIRE(bench.message.ground.impulse == ImpulseUnits{});
}

TEST_CASE(
    "the clutch: the finger stays, the force fades by the slew limit, and comes back softly") {
  Settings settings;
  settings.safety.slew_limit_n_per_s = 1000;
  settings.safety.fade_ms = 50;
  settings.safety.force_cap_n = 10;
  settings.mapping.motion_scale = 2;
  MappedBench bench(settings);
  bench.Run(300);
  for (int k = 0; k < 200; ++k) {
    bench.Place(Vec3(-0.01 + 0.002 * (k + 1) / 200, 0, 0));
    bench.Run(1);
  }
  bench.Run(300);
  REQUIRE(bench.message.pointers[0].force[0] == Approx(-4));
  const protocol::Vector there = bench.message.pointers[0].position;

  bench.wish.clutch = true;
  Vec3 before = bench.device.force;
  for (int k = 0; k < 300; ++k) {
    bench.device.next.position += Vec3(-1e-4, 5e-5, 0);  // the hand goes elsewhere
    bench.device.next.velocity = Vec3(-0.1, 0.05, 0);
    bench.Run(1);
    REQUIRE((bench.device.force - before).norm() <= 1.0);
    before = bench.device.force;
    REQUIRE(bench.message.pointers[0].position == there);
    REQUIRE(bench.message.pointers[0].velocity == protocol::Vector{});
    REQUIRE(bench.message.pointers[0].reason == ForceReason::kClutched);
    if (k >= 4) REQUIRE(bench.device.force.isZero(0));
  }

  bench.wish.clutch = false;
  bench.device.next.velocity.setZero();
  for (int k = 0; k < 200; ++k) {
    bench.Run(1);
    REQUIRE(bench.message.pointers[0].position == there);
    // 4 N over 200 ms of soft start: 0.02 N a tick, and in the first the same from the damper.
    REQUIRE((bench.device.force - before).norm() <= (k == 0 ? 0.0401 : 0.0201));
    before = bench.device.force;
  }
  bench.Run(100);
  REQUIRE(bench.message.pointers[0].force[0] == Approx(-4));
  // And the finger follows again.
  bench.device.next.position.x() -= 0.001;
  bench.Run(1);
  REQUIRE(bench.message.pointers[0].position[0] == Approx(there[0] - 0.002));
}

TEST_CASE("a finger that the mapping throws out of the world feels nothing") {
  Settings settings;
  settings.mapping.motion_scale = 1000;
  Bench bench(settings);
  bench.Run(10);
  bench.device.next.position = Vec3(1e11, 0, 0);
  bench.Run(1);
  REQUIRE(bench.message.pointers[0].reason == ForceReason::kNotFinite);
  REQUIRE(bench.device.force.isZero(0));
  REQUIRE(bench.message.pointers[0].position[0] == -50);
}

// Upright but for a turn, under a torque that the device could not do without.
class TurnedDevice final : public Device {
 public:
  DeviceStatus Read(std::int64_t, DeviceSample& sample) noexcept override {
    sample = next;
    return DeviceStatus::kOk;
  }
  Vec3 Write(const Vec3&) noexcept override { return Vec3::Zero(); }
  Vec3 torque() const noexcept override { return Vec3(0.01, -0.02, 0.03); }
  void Release() noexcept override {}
  std::string Name() const override { return "turned"; }

  DeviceSample next;
};

TEST_CASE("how the grip is turned, how fast, and the torque on it are published in the world") {
  const Settings settings = Mapped(5, 0.2);
  const Mapping mapping(settings.mapping);
  TurnedDevice device;
  const Vec3 axis(0.6, 0, -0.8);
  device.next.orientation = Quat(Eigen::AngleAxisd(0.7, axis));
  device.next.angular_velocity = 3 * axis;
  HapticStep step(settings, device, kOwnEpoch);
  protocol::HapticTick message;
  step.Tick({.start_ns = 1'000'000, .previous_duration_ns = 0, .missed = 0}, WorldInput{}, message,
            {});
  const protocol::Pointer& pointer = message.pointers[0];
  // The axis as the mapping lays directions into the world.
  const Vec3 axis_W = mapping.VelocityInWorld(axis) / 5;
  REQUIRE(ToQuat(pointer.orientation).angularDistance(Quat(Eigen::AngleAxisd(0.7, axis_W))) <
          1e-12);
  REQUIRE((ToVec3(pointer.angular_velocity) - 3 * axis_W).norm() < 1e-12);
  // A turn is the same in both, and so is torque times turn per force times way: s_x/s_f times the
  // torque.
  const Vec3 torque_W = mapping.VelocityInWorld(device.torque()) / 5 * (5 / 0.2);
  REQUIRE((ToVec3(pointer.torque) - torque_W).norm() < 1e-12);

  device.next.orientation.w() = std::nan("");
  step.Tick({.start_ns = 2'000'000, .previous_duration_ns = 1'000'000, .missed = 0}, WorldInput{},
            message, {});
  REQUIRE(message.pointers[0].reason == ForceReason::kNotFinite);
  REQUIRE(ToQuat(message.pointers[0].orientation).coeffs().allFinite());
}

TEST_CASE("a device that measures no orientation publishes none, however it lies in the world") {
  Bench bench(Mapped(5, 0.2));
  bench.Run(3);
  const protocol::Pointer still;
  REQUIRE(bench.message.pointers[0].orientation == still.orientation);
  REQUIRE(bench.message.pointers[0].angular_velocity == still.angular_velocity);
  REQUIRE(bench.message.pointers[0].torque == still.torque);
}

}  // namespace
}  // namespace rikiseki::haptic
