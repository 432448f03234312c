// SPDX-License-Identifier: MIT
// The whole tick of the shipped loop - peer link, ring, decoding, step, publishing - over real shared
// memory: it allocates nothing and takes no lock, while a world comes, dies and is replaced.
#include <unistd.h>

#include <catch2/catch.hpp>
#include <memory>
#include <thread>

#include "common/clock.h"
#include "haptic_server/device/make_device.h"
#include "haptic_server/loop.h"
#include "tests/haptic_server/guard.h"

namespace rikiseki::haptic {
namespace {

constexpr std::int64_t kPeriodNs = 1'000'000;

Settings RestingSettings() {
  Settings settings;
  settings.hand.script = HandScript::kRest;
  settings.hand.home_mm = Vec3::Zero();
  settings.spidar.motors_m = {Vec3(-0.265, 0.265, 0.265), Vec3(0.265, 0.265, -0.265),
                              Vec3(-0.265, -0.265, -0.265), Vec3(0.265, -0.265, 0.265)};
  return settings;
}

// A world that shows one plane through which the finger reaches 1 mm.
class FakeWorld {
 public:
  explicit FakeWorld(const std::string& instance)
      : owner_({.instance = instance,
                .role = protocol::Role::kWorld,
                .streams = protocol::WorldStreams(20'000'000, 1, 20'000'000),
                .build = "test",
                .runtime_directory = ""}),
        frames_(owner_.Writer<protocol::WorldFrame>()) {}

  void Publish(std::uint64_t haptic_epoch, std::uint64_t tick) {
    ++frame_.frame;
    frame_.period_ns = 20'000'000;
    frame_.acked_epoch = haptic_epoch;
    frame_.acked_tick = tick;
    frame_.baseline_tick = tick;
    frame_.plane_count = 1;
    frame_.planes[0].body = 1;
    frame_.planes[0].generation = 1;
    frame_.planes[0].point = {0.009, 0, 0};
    frame_.planes[0].normal = {-1, 0, 0};
    const auto now_ns = static_cast<std::uint64_t>(MonotonicNow());
    frames_.Publish(frame_, now_ns);
    owner_.Heartbeat(frame_.frame, now_ns);
  }

 private:
  protocol::SegmentOwner owner_;
  protocol::MessageWriter<protocol::WorldFrame> frames_;
  protocol::WorldFrame frame_;
};

TEST_CASE("a tick of the loop over shared memory allocates nothing and locks nothing") {
  const std::string instance = "loop-test-" + std::to_string(getpid());
  const Settings settings = RestingSettings();
  const auto device = MakeDevice(settings);
  protocol::SegmentOwner owner({.instance = instance,
                                .role = protocol::Role::kHaptic,
                                .streams = protocol::HapticStreams(kPeriodNs, 1024, 10 * kPeriodNs),
                                .build = "test",
                                .runtime_directory = ""});
  protocol::PeerLink link(
      {.peer = {.instance = instance, .role = protocol::Role::kWorld, .required = {}, .owners = {}},
       .poll_ms = 5});
  HapticStep step(settings, *device, owner.epoch());
  OperatorPanel panel;
  HapticLoop loop(settings, step, owner, link, panel);

  std::int64_t now_ns = MonotonicNow();
  bool touched = false;
  long allocated = 0;
  long locked = 0;
  for (int life = 0; life < 3; ++life) {
    auto world = std::make_unique<FakeWorld>(instance);
    // Attaching is the attacher's work: give it real time, then run ticks in virtual time.
    for (int wait = 0; wait < 400 && !link.HasNext(); ++wait) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    REQUIRE(link.HasNext());
    for (int k = 0; k < 1500; ++k) {
      now_ns += kPeriodNs;
      if (k % 20 == 0) world->Publish(owner.epoch(), step.health().ticks);
      const long allocations_before = test::Allocations();
      const long locks_before = test::Locks();
      loop.Tick(now_ns, now_ns - 40'000, 0);
      allocated += test::Allocations() - allocations_before;
      locked += test::Locks() - locks_before;
      touched = touched || loop.reason() == protocol::ForceReason::kContact;
    }
    world.reset();
  }
  const auto reason_of_next_tick = [&] {
    now_ns += kPeriodNs;
    loop.Tick(now_ns, now_ns, 0);
    return loop.reason();
  };
  panel.Stop();
  CHECK(reason_of_next_tick() == protocol::ForceReason::kEmergencyStop);
  CHECK(reason_of_next_tick() == protocol::ForceReason::kEmergencyStop);
  panel.Enable();
  CHECK(reason_of_next_tick() != protocol::ForceReason::kEmergencyStop);
  CHECK(touched);
  CHECK(allocated == 0);
  CHECK(locked == 0);
  loop.Stop();
  CHECK(loop.reason() == protocol::ForceReason::kStopped);
}

}  // namespace
}  // namespace rikiseki::haptic
