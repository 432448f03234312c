#include "tests/lab/coupled_run.h"

#include <catch2/catch.hpp>

#include "tests/lab/ideal_device.h"
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
  block.mass_kg = 1;
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

  Lab(double world_rate_hz, int phase_ticks, const Vec3& home)
      : world_settings(AtRate(world_rate_hz)),
        device(haptic::Hand([home](double) { return home; }, {1, 10, 100}),
               CoupledRun::StartNs(haptic_settings)),
        run(haptic_settings, device, world_settings, WallScene(),
            std::make_unique<world::SlidingBlock>(WallScene(), 0.1, world::SlideRule::kExact),
            phase_ticks) {}
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

TEST_CASE("a world period that is no multiple of the haptic one is refused") {
  CHECK_THROWS_AS(Lab(300, 0, Vec3(-0.005, 0, 0)), std::invalid_argument);
  CHECK_THROWS_AS(Lab(2000, 0, Vec3(-0.005, 0, 0)), std::invalid_argument);
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
