// SPDX-License-Identifier: MIT
// The step against worlds: the reference scenario, the books, a free body with a copy.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <random>
#include <tuple>
#include <vector>

#include "haptic_server/device/hand.h"
#include "tests/haptic_server/step_bench.h"

namespace rikiseki::haptic {
namespace {

using protocol::ForceReason;
using protocol::ImpulseUnits;
using protocol::Minus;
using protocol::Plus;

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
