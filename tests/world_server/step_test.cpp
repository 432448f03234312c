// SPDX-License-Identifier: MIT
#include "world_server/step.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <string>

#include "protocol/impulse_units.h"
#include "tests/world_server/scenes.h"
#include "world_server/physics/bullet_world.h"
#include "world_server/physics/sliding_block.h"

namespace rikiseki::world {
namespace {

using protocol::Channel;
using protocol::Coupling;
using protocol::DiscardReason;
using protocol::HapticTick;
using protocol::ImpulseUnits;
using protocol::WorldFrame;

constexpr double kPeriod = 0.05;

Settings With(Coupling coupling) {
  Settings settings;
  settings.coupling.coupling = coupling;
  settings.coupling.force_cap_n = 100;
  return settings;
}

WorldStep MakeStep(const Scene& scene, Coupling coupling = Coupling::kImpulse,
                   std::uint64_t own_epoch = 0) {
  return WorldStep(With(coupling), scene, std::make_unique<BulletWorld>(scene, 1e-3), own_epoch);
}

ImpulseUnits Units(const Vec3& si) {
  ImpulseUnits units{};
  for (std::size_t i = 0; i < 3; ++i) {
    units[i] = std::llround(si[static_cast<int>(i)] / protocol::kImpulseUnit);
  }
  return units;
}

HapticTick At(std::uint64_t tick, const Vec3& finger) {
  HapticTick message;
  message.tick = tick;
  message.stiffness = 2000;
  message.pointer_count = 1;
  message.pointers[0].radius = 0.01;
  message.pointers[0].position = ToArray(finger);
  return message;
}

// Adds a channel whose totals are a push of J at p.
void Push(HapticTick& message, std::uint32_t body, const Vec3& impulse, const Vec3& p,
          std::uint32_t generation = 1) {
  Channel& channel = message.channels[message.channel_count++];
  channel.body = body;
  channel.generation = generation;
  channel.opened_tick = 1;
  channel.impulse = Units(impulse);
  channel.angular_impulse = Units(p.cross(impulse));
}

Vec3 Velocity(const WorldStep& step, std::size_t body) {
  return ToVec3(step.Bodies()[body].velocity);
}

}  // namespace

TEST_CASE("the ack is the epoch and the last tick consumed, and nothing before the first message") {
  WorldStep step = MakeStep(test::CubeOnFloor(0.3));
  WorldFrame frame;
  step.Tick(kPeriod, frame);
  CHECK(frame.frame == 1);
  CHECK(frame.acked_epoch == 0);
  CHECK(frame.plane_count == 0);
  step.BeginHapticEpoch(9);
  step.Tick(kPeriod, frame);
  CHECK(frame.acked_epoch == 0);
  step.Consume(At(30, Vec3::Zero()));
  step.Consume(At(31, Vec3::Zero()));
  step.Tick(kPeriod, frame);
  CHECK(frame.frame == 3);
  CHECK(frame.acked_epoch == 9);
  CHECK(frame.acked_tick == 31);
  CHECK(frame.baseline_tick == 30);
  CHECK(frame.world_time_ns == 150'000'000);
  CHECK(frame.period_ns == 50'000'000);
  step.BeginHapticEpoch(10);
  step.Tick(kPeriod, frame);
  CHECK(frame.acked_epoch == 0);
  CHECK(frame.plane_count == 0);
  CHECK(step.health().frames == 4);
  CHECK(step.health().peer_epoch == 10);
}

TEST_CASE("an off-centre push gives a free cube the right velocity and spin") {
  const double mass = 0.5;
  WorldStep step = MakeStep(test::FreeCube(mass));
  step.BeginHapticEpoch(1);
  const Vec3 p(-0.03, 0.01, 0.02);
  const Vec3 impulse(0.2, 0, 0);
  HapticTick message = At(0, {-1, 0, 0});
  step.Consume(message);
  message.tick = 5;
  Push(message, 0, impulse, p);
  step.Consume(message);
  WorldFrame frame;
  step.Tick(kPeriod, frame);
  const double inertia = mass * 0.06 * 0.06 / 6;
  CHECK((Velocity(step, 0) - impulse / mass).norm() < 1e-12);
  CHECK((ToVec3(step.Bodies()[0].angular_velocity) - p.cross(impulse) / inertia).norm() < 1e-7);
  CHECK(frame.applied == Units(impulse));
  CHECK(frame.discarded == ImpulseUnits{});
  CHECK(step.health().applied == Units(impulse));
}

TEST_CASE("a free cube gains exactly the momentum that the frames say was applied, under loss") {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> uniform(-1, 1);
  WorldStep step = MakeStep(test::FreeCube(2));
  step.BeginHapticEpoch(1);
  Vec3 total = Vec3::Zero();
  WorldFrame frame;
  ImpulseUnits shown{};
  for (std::uint64_t tick = 1; tick <= 2000; ++tick) {
    if (tick > 1) total += 0.01 * Vec3(uniform(random), uniform(random), uniform(random));
    HapticTick message = At(tick, {-1, 0, 0});
    Push(message, 0, total, Vec3::Zero());
    if (tick == 1 || uniform(random) > 0) {
      step.Consume(message);
      shown = Units(total);
    }
    if (tick % 50 != 0) continue;
    step.Tick(kPeriod, frame);
    REQUIRE(frame.applied == shown);
    const Vec3 momentum = 2 * Velocity(step, 0);
    for (std::size_t i = 0; i < 3; ++i) {
      REQUIRE(momentum[static_cast<int>(i)] ==
              Approx(static_cast<double>(shown[i]) * 1e-12).margin(1e-12));
    }
  }
}

TEST_CASE("position: the sampled penetration pushes, impulses are declared not applied") {
  const Scene scene = test::FreeCube(0.5);
  WorldStep step = MakeStep(scene, Coupling::kPosition);
  step.BeginHapticEpoch(1);
  HapticTick message = At(1, {-0.039, 0, 0});
  step.Consume(message);
  message = At(2, {-0.038, 0, 0});  // 2 mm deep
  Push(message, 0, {0.7, 0, 0}, Vec3::Zero());
  message.channels[0].opened_tick = 2;
  step.Consume(message);
  WorldFrame frame;
  step.Tick(kPeriod, frame);
  CHECK(frame.coupling == Coupling::kPosition);
  CHECK(Velocity(step, 0).x() == Approx(2000 * 0.002 * kPeriod / 0.5).epsilon(1e-12));
  CHECK(frame.applied == ImpulseUnits{});
  CHECK(frame.discarded == Units({0.7, 0, 0}));
  CHECK(step.health().penalty_impulse[0] == Approx(0.2).epsilon(1e-12));
  const auto coupling = static_cast<std::size_t>(DiscardReason::kCoupling);
  CHECK(step.health().discarded[coupling] == Units({0.7, 0, 0}));
}

TEST_CASE("position: a finger not heard of for a gap pushes no longer") {
  Scene scene = test::FreeCube(1e6);  // hardly moves
  WorldStep step = MakeStep(scene, Coupling::kPosition);
  step.BeginHapticEpoch(1);
  step.Consume(At(1, {-0.038, 0, 0}));
  WorldFrame frame;
  for (int i = 0; i < 20; ++i) step.Tick(kPeriod, frame);
  // Gap 150 ms: the ticks at silence 0, 50, 100 and 150 ms push.
  CHECK(step.health().penalty_impulse[0] == Approx(4 * 2000 * 0.002 * kPeriod).epsilon(1e-3));
  step.BeginHapticEpoch(2);
  step.Tick(kPeriod, frame);
  CHECK(step.health().penalty_impulse[0] == Approx(4 * 2000 * 0.002 * kPeriod).epsilon(1e-3));
}

TEST_CASE("the sliding block stands behind the same step") {
  const Scene scene = test::CubeOnFloor(0.3, 0.06, 2.0);
  WorldStep step(With(Coupling::kImpulse), scene,
                 std::make_unique<SlidingBlock>(scene, 0.3, SlideRule::kExact), 0);
  step.BeginHapticEpoch(1);
  step.Consume(At(1, {-1, 0, 0.03}));
  HapticTick message = At(2, {-1, 0, 0.03});
  Push(message, 1, {2, 0, 0}, Vec3::Zero());
  message.channels[0].opened_tick = 2;
  step.Consume(message);
  WorldFrame frame;
  for (int i = 0; i < 20; ++i) step.Tick(kPeriod, frame);
  CHECK(step.Bodies()[1].position[0] == Approx(1 / (2 * 0.3 * 9.81)).epsilon(1e-12));
}

TEST_CASE("planes come with the body's generation and where the body is after the step") {
  WorldStep step = MakeStep(test::FreeCube(1));
  step.BeginHapticEpoch(1);
  step.Consume(At(1, {-0.05, 0, 0}));
  HapticTick message = At(2, {-0.05, 0, 0});
  Push(message, 0, {0.1, 0, 0}, Vec3::Zero());
  message.channels[0].opened_tick = 2;
  step.Consume(message);
  WorldFrame frame;
  step.Tick(kPeriod, frame);
  REQUIRE(frame.plane_count == 1);
  CHECK(frame.planes[0].generation == 1);
  CHECK(frame.planes[0].point[0] == Approx(-0.03 + 0.1 * kPeriod).epsilon(1e-9));
  CHECK(frame.planes[0].normal[0] == Approx(-1).epsilon(1e-12));
}

TEST_CASE("a restart: new generations, old pushes discarded, the books go on") {
  const Scene scene = test::FreeCube(1);
  WorldStep step = MakeStep(scene);
  step.BeginHapticEpoch(1);
  step.Consume(At(1, {-0.05, 0, 0}));
  HapticTick message = At(2, {-0.05, 0, 0});
  Push(message, 0, {0.1, 0, 0}, Vec3::Zero());
  message.channels[0].opened_tick = 2;
  step.Consume(message);
  WorldFrame frame;
  step.Tick(kPeriod, frame);
  message.tick = 3;
  message.channels[0].impulse = Units({0.3, 0, 0});
  step.Consume(message);  // pending when the scene goes
  step.Replace({.scene = scene,
                .dynamics = std::make_unique<BulletWorld>(scene, 1e-3),
                .how = Replacement::kRestart});
  message.tick = 4;
  message.channels[0].impulse = Units({0.4, 0, 0});
  step.Consume(message);  // still for the old body
  step.Tick(kPeriod, frame);
  CHECK(Velocity(step, 0) == Vec3::Zero());
  CHECK(step.Bodies()[0].generation == 2);
  REQUIRE(frame.plane_count == 1);
  CHECK(frame.planes[0].generation == 2);
  CHECK(frame.applied == Units({0.1, 0, 0}));
  CHECK(frame.discarded == Units({0.3, 0, 0}));
  CHECK(step.health().resets == 1);
  CHECK(frame.frame == 2);

  CHECK_THROWS_AS(step.Replace({.scene = test::CubeOnFloor(0.3),
                                .dynamics = std::make_unique<BulletWorld>(scene, 1e-3),
                                .how = Replacement::kRestart}),
                  std::invalid_argument);
}

TEST_CASE("pushes on the floor, and against another world, are discarded with their reason") {
  WorldStep step = MakeStep(test::CubeOnFloor(0.3), Coupling::kImpulse, /*own_epoch=*/42);
  step.BeginHapticEpoch(1);
  HapticTick message = At(1, {0, 0, 1});
  message.world_epoch = 41;
  Push(message, 1, Vec3::Zero(), Vec3::Zero());
  Push(message, 0, Vec3::Zero(), Vec3::Zero());
  step.Consume(message);
  message.tick = 2;
  message.channels[0].impulse = Units({0.5, 0, 0});
  step.Consume(message);
  message.tick = 3;
  message.world_epoch = 42;
  message.channels[1].impulse = Units({0, 0, -0.25});
  step.Consume(message);
  WorldFrame frame;
  step.Tick(kPeriod, frame);
  CHECK(frame.applied == ImpulseUnits{});
  CHECK(frame.discarded == Units({0.5, 0, -0.25}));
  const auto& discarded = step.health().discarded;
  CHECK(discarded[static_cast<std::size_t>(DiscardReason::kForeignWorld)] == Units({0.5, 0, 0}));
  CHECK(discarded[static_cast<std::size_t>(DiscardReason::kUnknownBody)] == Units({0, 0, -0.25}));
}

TEST_CASE("health says what runs") {
  WorldStep step = MakeStep(test::CubeOnFloor(0.3));
  CHECK(std::string(step.health().scene.data()) == "cube on floor");
  CHECK(step.health().moving_bodies == 1);
  CHECK(step.health().coupling == Coupling::kImpulse);
  CHECK(step.Bodies().size() == 2);
  CHECK(step.Bodies()[0].mass == 0);
  CHECK(step.Bodies()[1].mass == 1);
  Scene scene = test::FreeCube(1);
  scene.name = std::string(100, 'x');
  step.Replace({.scene = scene,
                .dynamics = std::make_unique<BulletWorld>(scene, 1e-3),
                .how = Replacement::kRestart});
  CHECK(std::string(step.health().scene.data()) == std::string(63, 'x'));
}

TEST_CASE("a static scene sends planes and steps nothing") {
  Scene scene;
  scene.bodies = {test::Floor(0.3)};
  auto dynamics = std::make_unique<BulletWorld>(scene, 1e-3);
  CHECK_FALSE(dynamics->simulates());
  WorldStep step(With(Coupling::kImpulse), scene, std::move(dynamics), 0);
  step.BeginHapticEpoch(1);
  step.Consume(At(1, {0, 0, 0.015}));
  WorldFrame frame;
  step.Tick(kPeriod, frame);
  REQUIRE(frame.plane_count == 1);
  CHECK(frame.planes[0].normal == protocol::Vector{0, 0, 1});
  CHECK(step.health().moving_bodies == 0);
}

TEST_CASE("whatever arrives, the frame is finite and the body not thrown farther than the cap") {
  for (const Coupling coupling : {Coupling::kImpulse, Coupling::kPosition}) {
    WorldStep step = MakeStep(test::FreeCube(1), coupling);
    step.BeginHapticEpoch(1);
    std::mt19937_64 random(6);
    WorldFrame frame;
    const double cap = 100 * 0.15;  // force cap times gap
    Vec3 before = Vec3::Zero();
    for (std::uint64_t round = 1; round <= 300; ++round) {
      HapticTick message;
      std::vector<std::uint64_t> noise(sizeof message / 8);
      for (std::uint64_t& word : noise) word = random();
      std::memcpy(static_cast<void*>(&message), noise.data(), noise.size() * 8);
      message.tick = round;
      for (Channel& channel : message.channels) {
        channel.body = 0;
        channel.generation = 1;
        for (std::int64_t& axis : channel.impulse) axis >>= random() % 64;
        for (std::int64_t& axis : channel.angular_impulse) axis >>= random() % 64;
      }
      if (round % 3 == 0) {
        message.pointers[0] = {};
        message.pointer_count = 1;
        message.pointers[0].position = {1e8, -1e8, std::ldexp(1.0, static_cast<int>(round) % 60)};
        message.pointers[0].radius = 1;
        message.stiffness = std::numeric_limits<double>::infinity();
      }
      step.Consume(message);
      step.Tick(kPeriod, frame);
      const protocol::Body& body = step.Bodies()[0];
      REQUIRE(ToVec3(body.position).allFinite());
      REQUIRE(ToVec3(body.angular_velocity).allFinite());
      REQUIRE((Velocity(step, 0) - before).norm() <= 4 * cap * (1 + 1e-9));
      before = Velocity(step, 0);
      for (std::uint32_t i = 0; i < frame.plane_count; ++i) {
        REQUIRE(ToVec3(frame.planes[i].point).allFinite());
        REQUIRE(ToVec3(frame.planes[i].normal).norm() == Approx(1));
      }
    }
  }
}

// The finger stands still and pushes with 20 N for 50 ms, into a body that it has no frame of.
TEST_CASE(
    "local: a body without a copy takes no more than the finger's work, the rest is declared") {
  const double mass = 0.02;
  for (const double way : {0.0, 0.002}) {
    WorldStep step = MakeStep(test::FreeCube(mass), Coupling::kLocal);
    step.BeginHapticEpoch(1);
    HapticTick message = At(0, {-0.045, 0, 0});
    message.period_ns = message.previous_duration_ns = 1'000'000;
    Push(message, 0, Vec3::Zero(), Vec3::Zero());
    step.Consume(message);
    for (std::uint64_t k = 1; k <= 50; ++k) {
      message.tick = k;
      message.start_ns = k * 1'000'000;
      message.channels[0].impulse = Units(Vec3(20e-3 * static_cast<double>(k), 0, 0));
      message.pointers[0].position[0] += way / 49;  // the first force is held from the second on
      step.Consume(message);
    }
    WorldFrame frame;
    step.Tick(kPeriod, frame);
    CHECK(frame.acked_tick == 50);
    const double taken = protocol::InSi(frame.applied)[0];
    CHECK(taken + protocol::InSi(frame.discarded)[0] == Approx(1).epsilon(1e-12));
    CHECK(taken * taken / (2 * mass) == Approx(20 * way).epsilon(1e-6));
    CHECK(ToVec3(step.Bodies()[0].velocity).x() * mass == Approx(taken).epsilon(1e-9));
  }
}

TEST_CASE(
    "local: the push is repeated tick by tick, and the frame holds the body that was moved so") {
  const double mass = 0.5;
  WorldStep step = MakeStep(test::FreeCube(mass), Coupling::kLocal);
  step.BeginHapticEpoch(1);
  HapticTick message = At(0, {-0.045, 0, 0});
  Push(message, 0, Vec3::Zero(), Vec3::Zero());
  message.period_ns = message.previous_duration_ns = 1'000'000;
  step.Consume(message);
  WorldFrame frame;
  step.Tick(kPeriod, frame);  // the finger has a copy of the cube from now on
  Vec3 impulse = Vec3::Zero();
  Vec3 way = Vec3::Zero();
  for (std::uint64_t k = 1; k <= 500; ++k) {
    if (k % 7 != 0) impulse += Vec3(1e-4 * static_cast<double>(k % 13), 0, 2e-5);
    way += 1e-3 * impulse / mass;
    message.tick = k;
    message.start_ns = k * 1'000'000;
    message.pointers[0].position = ToArray(Vec3(way - Vec3(0.045, 0, 0)));
    message.channels[0].impulse = Units(impulse);
    // It spins as well, which does not move the centre.
    step.Consume(message);
    if (k % 50 != 0) continue;
    step.Tick(kPeriod, frame);
    REQUIRE(frame.coupling == Coupling::kLocal);
    REQUIRE(frame.acked_tick == k);
    REQUIRE(frame.local_body_count == 1);
    REQUIRE(frame.local_substep_ns == 1'000'000);
    const protocol::LocalBody& local = frame.local_bodies[0];
    REQUIRE(local.body == 0);
    REQUIRE(local.mass == mass);
    REQUIRE(local.contact_count == 0);
    REQUIRE((ToVec3(local.velocity) - impulse / mass).norm() < 1e-10);
    REQUIRE((ToVec3(local.position) - way).norm() < 1e-9);
  }
  WorldStep other = MakeStep(test::FreeCube(mass), Coupling::kImpulse);
  other.BeginHapticEpoch(1);
  other.Consume(At(0, {-0.045, 0, 0}));
  other.Tick(kPeriod, frame);
  CHECK(frame.plane_count == 1);
  CHECK(frame.local_body_count == 0);
}

TEST_CASE("what does not exist is refused") {
  const Scene scene = test::FreeCube(1);
  CHECK_THROWS_AS(WorldStep(Settings{}, scene, nullptr, 0), std::invalid_argument);
}

}  // namespace rikiseki::world
