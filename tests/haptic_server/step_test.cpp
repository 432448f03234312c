#include "haptic_server/step.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <random>
#include <tuple>
#include <vector>

#include "haptic_server/device/hand.h"
#include "haptic_server/device/mapping.h"
#include "haptic_server/device/simulated_board.h"
#include "haptic_server/device/spidar.h"
#include "haptic_server/render/ledger.h"
#include "tests/haptic_server/test_device.h"

namespace rikiseki::haptic {
namespace {

using protocol::ForceReason;
using protocol::ImpulseUnits;
using protocol::Minus;
using protocol::PeerState;
using protocol::Plus;

constexpr std::int64_t kPeriodNs = 1'000'000;
constexpr std::uint64_t kOwnEpoch = 4242;

protocol::Plane WallFacing(const Vec3& point, const Vec3& normal, std::uint32_t body = 1) {
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

TEST_CASE("a finger in a wall feels k times the depth of its sphere, and the message says so") {
  Bench bench;
  bench.Run(400);
  REQUIRE(bench.message.pointers[0].reason == ForceReason::kNoContact);
  REQUIRE(bench.step.health().peer_state == PeerState::kLive);
  for (int i = 0; i < 60; ++i) {  // in slowly: an approach, no surprise
    bench.device.next.position.x() += 0.0007;
    bench.device.next.velocity.x() = 0.7;
    bench.Run(1);
  }
  bench.device.next.velocity.setZero();
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
  for (int i = 0; i < 60; ++i) {
    bench.device.next.position.x() += 0.0007;
    bench.device.next.velocity.x() = 0.7;
    bench.Run(1);
  }
  bench.device.next.velocity.setZero();
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
  for (int i = 0; i < 60; ++i) {
    bench.device.next.position.x() += 0.0007;
    bench.device.next.velocity.x() = 0.7;
    bench.Run(1);
  }
  bench.device.next.velocity.setZero();
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

// In contact with 4 N.
void PressOn(Bench& bench) {
  bench.Run(300);
  for (int i = 0; i < 60; ++i) {
    bench.device.next.position.x() += 0.0007;
    bench.device.next.velocity.x() = 0.7;
    bench.Run(1);
  }
  bench.device.next.velocity.setZero();
  REQUIRE(bench.Run(40).norm() == Approx(4).epsilon(1e-6));
}

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
  const FourStrings loose = {0.5, 0.5, 0.5, 0.5};
  run(500);
  REQUIRE(ToVec3(message.pointers[0].force).norm() > 0.5);
  REQUIRE(board.tension() != loose);
  board.SetEnabled(false);
  run(1);
  REQUIRE(message.pointers[0].reason == ForceReason::kEmergencyStop);
  REQUIRE(board.tension() == loose);
  board.SetEnabled(true);
  run(100);
  REQUIRE(board.tension() == loose);
}

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

// The block of the reference scenario P: exact Coulomb slide, pushed by impulses.
struct Block {
  double mass = 0.5, friction = 0.1, x = 0, v = 0;

  void Step(double impulse, double period_s) {
    v += impulse / mass;
    const double drag = friction * 9.81;
    const double dv = drag * period_s;
    if (std::abs(v) <= dv) {
      x += v * std::abs(v) / (2 * drag);
      v = 0;
    } else {
      const double sign = v > 0 ? 1 : -1;
      x += period_s * v - sign * drag * period_s * period_s / 2;
      v -= sign * dv;
    }
  }
};

TEST_CASE("scenario P with coupling impulse ends where the independent reference says") {
  struct Row {
    DisplayRule display;
    double mass;
    int phase;
    double x_final, impulse;
  };
  // Computed independently of this project: scenario P, rule EX, Tw 50 ms, kp 2000, kd 0.
  const Row rows[] = {
      {DisplayRule::kInterpolate, 0.5, 0, 0.0859998036, 0.20538477},
      {DisplayRule::kInterpolate, 0.5, 30, 0.0602763131, 0.189901081},
      {DisplayRule::kInterpolate, 0.5, 40, 0.078648173, 0.198921903},
      {DisplayRule::kHold, 0.5, 30, 0.0281410465, 0.132167463},
      {DisplayRule::kHold, 0.5, 40, 0.0650878714, 0.178677365},
      {DisplayRule::kExtrapolate, 0.5, 30, 0.0205281906, 0.113140992},
      {DisplayRule::kInterpolate, 2.0, 40, 0.00466179383, 0.203707144},
      {DisplayRule::kExtrapolate, 2.0, 40, 0.004110783, 0.180734956},
  };
  for (const Row& row : rows) {
    CAPTURE(static_cast<int>(row.display), row.mass, row.phase);
    Settings settings;
    settings.render.damping_ns_per_m = 0;
    settings.render.adhesion = true;
    settings.render.display = row.display;
    settings.render.finger_radius_mm = 0;
    settings.safety.soft_start_ms = 0;
    settings.safety.force_cap_n = 1e4;
    settings.safety.slew_limit_n_per_s = 1e9;
    Bench bench(settings, 0);
    Hand hand(MotorProgram({.home = Vec3(-0.04, 0, 0),
                            .strokes = {{Vec3(0.02, 0, 0), 0.12}, {Vec3(-0.04, 0, 0), 0.12}}}),
              {0.13, 2.2, 50});
    Block block{.mass = row.mass};
    bench.device.next.position = hand.position();
    for (int k = -5; k < 0; ++k) bench.Tick(&bench.NextFrame());  // the world comes to life
    for (int i = 0; i < 50; ++i) bench.Tick();

    std::int64_t consumed = 0;
    double all = 0;
    for (int k = 0; k < 3000; ++k) {
      const protocol::WorldFrame* frame = nullptr;
      if (k >= row.phase && (k - row.phase) % 50 == 0) {
        const std::int64_t total =
            bench.message.channel_count > 0 ? bench.message.channels[0].impulse[0] : consumed;
        const double impulse = static_cast<double>(total - consumed) * 1e-12;
        consumed = total;
        all += impulse;
        block.Step(impulse, 0.05);
        bench.planes = {WallFacing(Vec3(block.x, 0, 0), -Vec3::UnitX())};
        frame = &bench.NextFrame();
      }
      bench.device.next.position = hand.position();
      const Vec3 force = bench.Tick(frame);
      hand.Advance(kPeriodNs, force);
    }
    REQUIRE(std::abs(block.x - row.x_final) < 1e-9);
    REQUIRE(std::abs(all - row.impulse) < 1e-8);
  }
}

// A world that reads messages as SPEC section 7 wants it: totals, channel by channel, from a
// baseline.
class ReadingWorld {
 public:
  explicit ReadingWorld(std::uint64_t own_epoch) : epoch(own_epoch) {}

  // Applies or discards everything up to `message` and acknowledges it.
  void Read(const protocol::HapticTick& message, bool discard, protocol::WorldFrame& frame) {
    ImpulseUnits delta{};
    std::map<Key, ImpulseUnits> now;
    for (std::uint32_t i = 0; i < message.channel_count; ++i) {
      const protocol::Channel& channel = message.channels[i];
      const Key key{channel.body, channel.generation, channel.opened_tick};
      now[key] = channel.impulse;
      delta = Plus(delta, Minus(channel.impulse, seen_[key]));  // new ones count from zero
    }
    seen_ = now;
    if (!baseline_) {
      baseline_ = message.tick;
    } else if (discard || message.world_epoch != epoch) {
      discarded = Plus(discarded, delta);
    } else {
      applied = Plus(applied, delta);
    }
    frame.acked_epoch = kOwnEpoch;
    frame.acked_tick = message.tick;
    frame.baseline_tick = *baseline_;
    frame.applied = applied;
    frame.discarded = discarded;
  }

  std::uint64_t epoch;
  ImpulseUnits applied{}, discarded{};

 private:
  using Key = std::tuple<std::uint32_t, std::uint32_t, std::uint64_t>;
  std::map<Key, ImpulseUnits> seen_;
  std::optional<std::uint64_t> baseline_;
};

TEST_CASE(
    "the books balance exactly through jitter, lost frames, dying worlds and changing bodies") {
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    std::mt19937_64 random(seed);
    const auto chance = [&](unsigned percent) { return random() % 100 < percent; };
    Bench bench;
    auto world = std::make_unique<ReadingWorld>(100);
    bench.world.epoch = 100;
    int world_frames = 0;
    ImpulseUnits applied{}, discarded{};  // by worlds of the past, as far as their frames were seen
    ImpulseUnits world_applied{}, world_discarded{};
    std::vector<ImpulseUnits> displayed;
    std::int64_t acked = -1;
    Vec3 true_impulse = Vec3::Zero();
    double time_s = 0;
    protocol::HapticTick published;  // the newest that the world can see
    protocol::WorldFrame made;       // its newest frame, which arrives in tick `due`
    int due = -1;
    bool alive = true;
    std::map<std::uint64_t, int> worlds_pushed;
    for (int k = 0; k < 40'000; ++k) {
      const protocol::WorldFrame* frame = nullptr;
      if (k > 0 && alive && k % 25 == 0) {
        made = bench.NextFrame();
        made.period_ns = 25'000'000;
        if (world_frames++ > 0) world->Read(published, chance(20), made);
        // Some frames are overwritten by the next before they are looked at.
        due = chance(30) ? -1 : k + static_cast<int>(random() % 20);
      }
      if (alive && k == due) frame = &made;
      if (frame != nullptr && frame->acked_epoch != 0) {
        acked = static_cast<std::int64_t>(frame->acked_tick);
        world_applied = frame->applied;
        world_discarded = frame->discarded;
      }
      if (alive && random() % 3000 == 0) {  // dies
        alive = false;
        bench.world.ready = random() % 2 == 0;
      } else if (!alive && random() % 200 == 0) {  // restarts, often before its force has faded
        alive = true;
        applied = Plus(applied, world_applied);
        discarded = Plus(discarded, world_discarded);
        world_applied = world_discarded = {};
        world = std::make_unique<ReadingWorld>(world->epoch + 1);
        bench.world.epoch = world->epoch;
        bench.world.ready = true;
        bench.frame_number = 0;
        world_frames = 0;
      }
      if (k % 500 == 0) {  // other bodies come near
        const auto body = [&] { return static_cast<std::uint32_t>(random() % 6); };
        bench.planes = {WallFacing(Vec3::Zero(), -Vec3::UnitX(), body()),
                        WallFacing(Vec3(0, -0.02, 0), Vec3(0.2, 1, 0).normalized(), body())};
      }
      bench.beats = alive;
      time_s += 1e-3;
      bench.device.next.position =
          Vec3(-0.012 + 0.006 * std::sin(7 * time_s), -0.012 + 0.003 * std::sin(3.1 * time_s), 0);
      bench.device.next.velocity = Vec3(0.042 * std::cos(7 * time_s), 0, 0);
      const std::int64_t duration =
          kPeriodNs + static_cast<std::int64_t>(random() % 1'000'001) - 500'000;
      const Vec3 force = bench.Tick(frame, duration);
      true_impulse -= force * 1e-9 * static_cast<double>(k + 1 < 40'000 ? duration : kPeriodNs);
      published = bench.message;
      if (!force.isZero(0)) ++worlds_pushed[bench.message.world_epoch];

      const protocol::Books& books = bench.step.health().books;
      displayed.push_back(books.displayed);
      REQUIRE(books.covered == Plus(books.applied, books.discarded));
      const ImpulseUnits up_to_ack =
          acked < 0 ? ImpulseUnits{} : displayed[static_cast<std::size_t>(acked)];
      REQUIRE(Plus(books.covered, books.peer_lost) == up_to_ack);
      REQUIRE(books.applied == Plus(applied, world_applied));
      REQUIRE(books.discarded == Plus(discarded, world_discarded));
      REQUIRE(bench.message.ground.impulse == books.ground);
    }
    const protocol::Books& books = bench.step.health().books;
    for (std::size_t i = 0; i < 3; ++i) {
      const double booked = 1e-12 * static_cast<double>(Plus(books.displayed, books.ground)[i]);
      REQUIRE(booked == Approx(true_impulse[static_cast<Eigen::Index>(i)]).margin(1e-11));
    }
    REQUIRE(worlds_pushed.size() > 2);
    REQUIRE(books.applied != ImpulseUnits{});
    REQUIRE(books.discarded != ImpulseUnits{});
    REQUIRE(books.peer_lost != ImpulseUnits{});
  }
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

// A world that is exact: body 1 of 0.5 kg is a free cube of 6 cm whose near face is at x = 0, pushed as
// the channel says, tick by tick. Its frames are `latency` ticks old when they arrive.
TEST_CASE("a free body with a copy is felt as without a world in between, at any latency") {
  const double mass = 0.5;
  for (const std::size_t latency : {0, 10, 50, 120}) {
    Settings settings;
    settings.render.damping_ns_per_m = 0;
    Bench bench(settings);
    std::vector<double> position = {0};  // after each tick
    std::vector<double> velocity = {0};
    double impulse = 0;
    double largest = 0;
    int in_contact = 0;
    for (std::size_t k = 0; k < 2000; ++k) {
      const double t = std::max(0.0, static_cast<double>(k) * 1e-3 - 0.4);
      bench.device.next.position = {-0.02 + 0.02 * std::sin(2 * t), 0, 0};
      bench.device.next.velocity = {t > 0 ? 0.04 * std::cos(2 * t) : 0, 0, 0};
      const protocol::WorldFrame* frame = nullptr;
      if (k % 50 == 0) {
        const std::size_t acked = k > latency ? k - latency - 1 : 0;
        const std::size_t after = k > latency ? acked + 1 : 0;
        bench.planes = {WallFacing(Vec3(position[after], 0, 0), -Vec3::UnitX())};
        protocol::WorldFrame& next = bench.NextFrame();
        if (k > latency) {
          next.acked_epoch = kOwnEpoch;
          next.acked_tick = acked;
        }
        next.local_body_count = 1;
        next.local_substep_ns = 1'000'000;
        protocol::LocalBody& local = next.local_bodies[0];
        local.body = 1;
        local.mass = mass;
        local.inertia = {3e-4, 0, 0, 3e-4, 0, 3e-4};
        local.position = {position[after] + 0.03, 0, 0};
        local.velocity = {velocity[after], 0, 0};
        frame = &next;
      }
      const double felt = bench.Tick(frame).x();
      CAPTURE(latency, k);
      // The spring against the body as it is, the finger's sphere of 1 cm before it.
      const double depth = bench.device.next.position.x() + 0.01 - position[k];
      if (bench.message.pointers[0].reason == ForceReason::kContact) {
        REQUIRE(felt == Approx(-2000 * std::max(0.0, depth)).margin(1e-8));
        ++in_contact;
        largest = std::max(largest, -felt);
      }
      for (std::uint32_t i = 0; i < bench.message.channel_count; ++i) {
        const protocol::Channel& channel = bench.message.channels[i];
        if (channel.body != 1) continue;
        const double total = static_cast<double>(channel.impulse[0]) * 1e-12;
        // A channel that was closed and freed begins again at 0.
        velocity.resize(k + 1);
        velocity.push_back(velocity[k] +
                           (channel.opened_tick == k ? total : total - impulse) / mass);
        impulse = total;
      }
      if (velocity.size() < k + 2) velocity.push_back(velocity[k]);
      position.push_back(position[k] + 1e-3 * velocity[k + 1]);
    }
    CHECK(in_contact > 20);
    CHECK(largest > 1);
    CHECK(position.back() > 0.01);
    CHECK(bench.step.health().reconciliation.frames > 20);
    CHECK(bench.step.health().reconciliation.largest_jump < 1e-11);
  }
}

}  // namespace
}  // namespace rikiseki::haptic
