// SPDX-License-Identifier: MIT
// The world's loop over real shared memory: it leaves a haptic side that died only after it has read and
// acknowledged everything that it published, whenever in a tick the death happens. SPEC.md 5.3.
#include "world_server/loop.h"

#include <unistd.h>

#include <catch2/catch.hpp>
#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <thread>

#include "common/clock.h"
#include "tests/world_server/scenes.h"

namespace rikiseki::world {
namespace {

constexpr std::int64_t kTickNs = 1'000'000;

// A haptic side that pushes body 0 with `newtons` along x.
class HapticSide {
 public:
  explicit HapticSide(const std::string& instance)
      : owner_({.instance = instance,
                .role = protocol::Role::kHaptic,
                .streams = protocol::HapticStreams(kTickNs, 256, 10 * kTickNs),
                .build = "loop test",
                .runtime_directory = ""}),
        ticks_(owner_.Writer<protocol::HapticTick>()) {}

  void Publish(std::uint64_t world_epoch) {
    protocol::HapticTick tick;
    tick.tick = number_++;
    tick.start_ns = static_cast<std::uint64_t>(MonotonicNow());
    tick.period_ns = kTickNs;
    tick.world_epoch = world_epoch;
    tick.channel_count = 1;
    tick.channels[0].body = 0;
    tick.channels[0].generation = 1;
    tick.channels[0].impulse = {static_cast<std::int64_t>(number_) * 1'000'000, 0, 0};
    ticks_.Publish(tick, tick.start_ns);
    owner_.Heartbeat(tick.tick, tick.start_ns);
  }

  std::uint64_t epoch() const { return owner_.epoch(); }
  std::uint64_t last_tick() const { return number_ - 1; }

 private:
  protocol::SegmentOwner owner_;
  protocol::MessageWriter<protocol::HapticTick> ticks_;
  std::uint64_t number_ = 0;
};

// Dynamics that let something happen in the middle of a world tick.
class Interrupted final : public DynamicsWorld {
 public:
  explicit Interrupted(std::function<void()>& interrupt) : interrupt_(interrupt) {}
  std::size_t body_count() const override { return 1; }
  BodyState State(std::size_t) const override { return {}; }
  void SetState(std::size_t, const BodyState&) override {}
  void ApplyAndStep(std::span<const Kick>, double) override {
    if (interrupt_) interrupt_();
  }
  bool FindContacts(std::size_t, double, std::vector<ContactSite>&) const override { return false; }

 private:
  std::function<void()>& interrupt_;
};

bool Eventually(const std::function<bool()>& condition) {
  for (int i = 0; i < 10'000 && !condition(); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return condition();
}

TEST_CASE(
    "a haptic side that dies and is replaced within a world tick is acknowledged to its end") {
  const std::string instance = "test-" + std::to_string(getpid()) + "-loop";
  Settings settings;
  settings.coupling.coupling = protocol::Coupling::kImpulse;  // which steps in every tick
  const Scene scene = test::FreeCube(1);
  protocol::SegmentOwner owner({.instance = instance,
                                .role = protocol::Role::kWorld,
                                .streams = protocol::WorldStreams(50'000'000, 1, 50'000'000),
                                .build = "loop test",
                                .runtime_directory = ""});
  protocol::PeerLink link({.peer = {.instance = instance,
                                    .role = protocol::Role::kHaptic,
                                    .required = {},
                                    .owners = {}},
                           .poll_ms = 2});
  std::function<void()> interrupt;
  WorldStep step(settings, scene, std::make_unique<Interrupted>(interrupt), owner.epoch());
  WorldLoop loop(settings, step, owner, link);
  const auto run = [&] { loop.Tick(MonotonicNow(), MonotonicNow(), 0); };
  const auto frames = protocol::Attach(
      {.instance = instance, .role = protocol::Role::kWorld, .required = {}, .owners = {}});
  REQUIRE(frames.view != nullptr);
  auto reader = frames.view->Reader<protocol::WorldFrame>();
  protocol::WorldFrame frame;
  const auto newest = [&] {
    REQUIRE(reader.ReadLatest(frame) == protocol::ReadStatus::kFresh);
    return frame;
  };

  auto first = std::make_unique<HapticSide>(instance);
  first->Publish(owner.epoch());
  REQUIRE(Eventually([&] { return link.HasNext(); }));
  run();  // turns to the first
  run();
  REQUIRE(newest().acked_epoch == first->epoch());

  // After the ledger was drained, before the tick ends: one more push, the end, and a successor.
  std::unique_ptr<HapticSide> second;
  const std::uint64_t first_epoch = first->epoch();
  std::uint64_t last_tick = 0;
  interrupt = [&] {
    if (second != nullptr) return;
    first->Publish(owner.epoch());
    last_tick = first->last_tick();
    first.reset();
    second = std::make_unique<HapticSide>(instance);
    second->Publish(owner.epoch());
    REQUIRE(Eventually([&] { return link.HasNext(); }));
  };
  run();
  REQUIRE(second != nullptr);
  CHECK(newest().acked_tick < last_tick);
  run();
  CHECK(newest().acked_epoch == first_epoch);
  CHECK(frame.acked_tick == last_tick);
  CHECK(frame.applied == protocol::ImpulseUnits{1'000'000, 0, 0});
  run();
  CHECK(newest().acked_epoch == second->epoch());
}

}  // namespace
}  // namespace rikiseki::world
