// SPDX-License-Identifier: MIT
#include "tests/lab/coupled_run.h"

#include <catch2/catch.hpp>

#include "tests/lab/ideal_device.h"
#include "tests/lab/prescribed_device.h"
#include "world_server/physics/sliding_block.h"

namespace rikiseki::lab {
namespace {

world::Settings AtRate(double rate_hz) {
  world::Settings settings;
  settings.loop.rate_hz = rate_hz;
  return settings;
}

world::Scene WallScene() {
  world::Collider face;
  face.shape = world::HalfSpace{.normal = -Vec3::UnitX()};
  world::SceneBody block;
  block.name = "block";
  block.mass_kg = 1000;  // what was pushed in a silence comes as one kick, which must not matter
  block.inertia = Mat3::Identity();
  block.colliders = {face};
  world::Scene scene;
  scene.bodies = {block};
  return scene;
}

struct Lab {
  haptic::Settings haptic_settings;
  world::Settings world_settings;
  IdealDevice device;
  CoupledRun run;

  Lab(double world_rate_hz, int phase_ticks, const Vec3& home, int latency_ticks = 0)
      : world_settings(AtRate(world_rate_hz)),
        device(haptic::Hand([home](double) { return home; }, {1, 10, 100}),
               CoupledRun::StartNs(haptic_settings)),
        run(haptic_settings, device, world_settings, WallScene(),
            std::make_unique<world::SlidingBlock>(WallScene(), 0.1, world::SlideRule::kExact),
            phase_ticks, latency_ticks) {}
};

}  // namespace

TEST_CASE("the world ticks at its phase and then every n haptic ticks") {
  Lab lab(50, 7, Vec3(-0.005, 0, 0));
  for (int k = 0; k < 100; ++k) CHECK(lab.run.Tick() == (k % 20 == 7));
  CHECK(lab.run.world().health().frames == kMeetingTicks - 1 + 5);
}

TEST_CASE("a world tick knows everything up to the tick before, and is shown at once") {
  Lab lab(50, 0, Vec3(-0.005, 0, 0));
  for (int k = 0; k < 100; ++k) {
    const bool ticked = lab.run.Tick();
    CHECK(lab.run.haptic_tick().tick == static_cast<std::uint64_t>(k + kMeetingTicks));
    CHECK(lab.run.haptic_tick().start_ns ==
          static_cast<std::uint64_t>((k + kMeetingTicks) * 1'000'000));
    if (!ticked) continue;
    CHECK(lab.run.world_frame().acked_tick == static_cast<std::uint64_t>(k + kMeetingTicks - 1));
    CHECK(lab.run.haptic_tick().world_frame == lab.run.world_frame().frame);
    CHECK(lab.run.haptic_health().feature_age_ns == 0);
  }
}

TEST_CASE("the loops have met at tick 0: the wall is felt from there on") {
  Lab lab(50, 19, Vec3(0.001, 0, 0));
  lab.run.Tick();
  CHECK(lab.run.haptic_health().peer_state == protocol::PeerState::kLive);
  CHECK(lab.run.world_frame().plane_count == 1);
  CHECK(lab.run.world_frame().world_time_ns == 0);
}

TEST_CASE(
    "a world period that is no multiple of the haptic one: the next haptic tick after its due "
    "time") {
  // 0.625 ms after phase 3: due at 3, 3.625, 4.25, ... so every tick from 3 on has one, or two as one.
  Lab fast(1600, 3, Vec3(-0.005, 0, 0));
  for (int k = 0; k < 20; ++k) CHECK(fast.run.Tick() == (k >= 3));
  // 3.333333 ms: due at 7, 10.33, 13.67, 17, ...; the world follows the haptic ticks it consumed.
  Lab slow(300, 7, Vec3(-0.005, 0, 0));
  std::uint64_t before_ns = 0;
  std::uint64_t acked = 0;
  for (int k = 0; k < 60; ++k) {
    const bool due = k >= 7 && (3 * (k - 7)) % 10 < 3;
    CAPTURE(k);
    REQUIRE(slow.run.Tick() == due);
    if (!due) continue;
    const protocol::WorldFrame& frame = slow.run.world_frame();
    const std::uint64_t advanced_ns = frame.world_time_ns - before_ns;
    CHECK(advanced_ns == (before_ns == 0 ? 3'333'333 : (frame.acked_tick - acked) * 1'000'000));
    before_ns = frame.world_time_ns;
    acked = frame.acked_tick;
  }
}

TEST_CASE("a frame is shown its latency later, its acks unchanged") {
  for (const int latency : {0, 1, 7, 20, 33}) {
    Lab lab(50, 5, Vec3(-0.005, 0, 0), latency);
    std::uint64_t shown = lab.run.haptic_tick().world_frame;
    for (int k = 0; k < 200; ++k) {
      CAPTURE(latency, k);
      const bool ticked = lab.run.Tick();
      CHECK(ticked == (k % 20 == 5));
      if (ticked) {
        CHECK(lab.run.world_frame().acked_tick ==
              static_cast<std::uint64_t>(k + kMeetingTicks - 1));
      }
      const std::uint64_t newest = lab.run.haptic_tick().world_frame;
      const bool arrives = k >= 5 + latency && (k - 5 - latency) % 20 == 0;
      CHECK((newest == shown + 1) == arrives);
      CHECK(newest == kMeetingTicks - 1 + static_cast<std::uint64_t>((k - 5 - latency + 20) / 20));
      shown = newest;
    }
  }
  CHECK_THROWS_AS(Lab(50, 0, Vec3(-0.005, 0, 0), -1), std::invalid_argument);
}

TEST_CASE("a silent world is lost, and comes back") {
  Lab lab(50, 0, Vec3(0.001, 0, 0));
  const auto state = [&] { return lab.run.haptic_health().peer_state; };
  for (int k = 0; k < 100; ++k) lab.run.Tick();
  REQUIRE(state() == protocol::PeerState::kLive);
  const std::uint64_t before_ns = lab.run.world_frame().world_time_ns;
  lab.run.SilenceWorld(true);
  for (int k = 0; k < 5000; ++k) CHECK_FALSE(lab.run.Tick());
  CHECK(state() == protocol::PeerState::kAbsent);
  CHECK(lab.run.haptic_tick().pointers[0].force == protocol::Vector{});
  lab.run.SilenceWorld(false);
  for (int k = 0; k < 100; ++k) lab.run.Tick();
  CHECK(state() == protocol::PeerState::kLive);
  CHECK(lab.run.haptic_tick().pointers[0].force[0] < 0);
  // It makes up for its gap, not for all the silence: 100 ms and four periods more.
  CHECK(lab.run.world_frame().world_time_ns - before_ns == 100'000'000 + 4 * 20'000'000);
}

TEST_CASE("the prescribed finger follows its path whatever it feels") {
  const auto path = [](double t_s) { return Vec3(0.1 * t_s, 0.02, 0); };
  PrescribedDevice device(path, 5'000'000);
  haptic::DeviceSample sample;
  for (const std::int64_t now_ns : {0, 2'000'000, 5'000'000}) {
    CHECK(device.Read(now_ns, sample) == haptic::DeviceStatus::kOk);
    CHECK(sample.position == Vec3(0, 0.02, 0));
    CHECK(sample.velocity.isZero(0));
  }
  CHECK(device.Write(Vec3(-2, 0, 0)) == Vec3(-2, 0, 0));
  device.Read(15'000'000, sample);
  CHECK(sample.position.x() == Approx(0.001));
  CHECK(sample.target == sample.position);
  CHECK(sample.velocity.x() == Approx(0.1));
  device.Release();
  device.Read(25'000'000, sample);
  CHECK(sample.position.x() == Approx(0.002));
}

TEST_CASE("the ideal device rests until its start, then follows the hand under the held force") {
  const auto path = [](double t_s) { return Vec3(0.1 * t_s, 0, 0); };
  IdealDevice device(haptic::Hand(path, {1, 10, 100}), 5'000'000);
  haptic::DeviceSample sample;
  for (const std::int64_t now_ns : {0, 2'000'000, 5'000'000}) {
    CHECK(device.Read(now_ns, sample) == haptic::DeviceStatus::kOk);
    CHECK(sample.position.isZero(0));
  }
  CHECK(device.Write(Vec3(-2, 0, 0)) == Vec3(-2, 0, 0));
  device.Read(2'005'000'000, sample);  // 2 s = ten time constants 2m/b: the spring has settled
  CHECK(sample.target.x() == Approx(0.2).epsilon(1e-12));
  CHECK(sample.position.x() == Approx(0.2 - 2.0 / 100).epsilon(1e-4));
  CHECK(sample.velocity.x() == Approx((0.2 - 0.02) / 2).epsilon(1e-4));
  device.Release();
  device.Read(6'005'000'000, sample);
  CHECK(sample.position.x() == Approx(0.6).epsilon(1e-6));
}

}  // namespace rikiseki::lab
