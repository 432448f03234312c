// SPDX-License-Identifier: MIT
#include "haptic_server/safety/safety_stage.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <random>

namespace rikiseki::haptic {
namespace {

using protocol::ForceReason;
using protocol::PeerState;

constexpr std::int64_t kPeriodNs = 1'000'000;

// The stage with a device that displays what it is told.
struct Bench {
  explicit Bench(const Settings& used = Settings{}) : settings(used), stage(used) {
    input.device_ok = input.sample_finite = true;
    input.peer = PeerState::kLive;
    input.previous_duration_ns = kPeriodNs;
  }
  Vec3 Step(const Vec3& wanted) {
    input.wanted = wanted;
    const Vec3 force = stage.Limit(input);
    stage.Displayed(force);
    return force;
  }
  Vec3 Run(int ticks, const Vec3& wanted) {
    Vec3 force = Vec3::Zero();
    for (int i = 0; i < ticks; ++i) force = Step(wanted);
    return force;
  }

  Settings settings;
  SafetyStage stage;
  SafetyInput input;
};

const Vec3 kPush(3, -1, 2);

TEST_CASE("after the soft start the force is what was rendered") {
  Bench bench;
  for (int k = 1; k < 200; ++k) {
    REQUIRE((bench.Step(kPush) - k / 200.0 * kPush).norm() < 1e-12);
    REQUIRE(bench.stage.reason() == ForceReason::kSoftStart);
  }
  bench.Step(kPush);
  REQUIRE(bench.Step(kPush) == kPush);
  REQUIRE(bench.stage.reason() == ForceReason::kContact);
  REQUIRE(bench.Step(Vec3::Zero()).isZero(0));
  REQUIRE(bench.stage.reason() == ForceReason::kNoContact);
}

TEST_CASE("a soft start of zero starts hard") {
  Settings settings;
  settings.safety.soft_start_ms = 0;
  Bench bench(settings);
  REQUIRE(bench.Step(kPush) == kPush);
}

TEST_CASE("the cap keeps the direction") {
  Bench bench;
  const Vec3 force = bench.Run(300, 100 * kPush);
  REQUIRE(force.norm() <= 10);
  REQUIRE(force.norm() == Approx(10).epsilon(1e-12));
  REQUIRE(force.normalized().dot(kPush.normalized()) == Approx(1));
  REQUIRE(bench.stage.reason() == ForceReason::kCapped);
}

TEST_CASE("the slew limit holds against what was displayed, not what was commanded") {
  Bench bench;
  bench.Run(300, Vec3::Zero());
  bench.input.wanted = Vec3(9, 0, 0);
  REQUIRE(bench.stage.Limit(bench.input).x() == Approx(5));
  bench.stage.Displayed(Vec3(1, 0, 0));  // the strings could not do it
  REQUIRE(bench.stage.reason() == ForceReason::kTensionLimited);
  REQUIRE(bench.Step(Vec3(9, 0, 0)).x() == Approx(6));
  REQUIRE(bench.stage.reason() == ForceReason::kSlewLimited);
}

TEST_CASE("a device that does not follow cannot hold the command up") {
  Settings settings;
  settings.safety.force_cap_n = 2;
  settings.safety.slew_limit_n_per_s = 200;  // 0.2 N a tick: 11 ticks from the cap to zero
  Bench bench(settings);
  bench.Run(300, kPush);
  bench.input.peer = PeerState::kLost;
  bench.input.wanted = kPush;
  int ticks = 0;
  for (; !bench.stage.is_zero() && ticks < 1000; ++ticks) {
    bench.stage.Limit(bench.input);
    bench.stage.Displayed(Vec3(1.5, 0, 0));
  }
  REQUIRE(ticks <= 80 + 13);
}

TEST_CASE("small tension residues are not worth a reason") {
  Bench bench;
  bench.Run(300, kPush);
  bench.input.wanted = kPush;
  bench.stage.Limit(bench.input);
  bench.stage.Displayed(kPush + Vec3(0.03, 0, 0));
  REQUIRE(bench.stage.reason() == ForceReason::kContact);
}

TEST_CASE("a lost world fades out over fade_ms, a world that is not there gives nothing") {
  Bench bench;
  bench.Run(300, kPush);
  bench.input.peer = PeerState::kLate;
  REQUIRE(bench.Step(kPush) == kPush);
  REQUIRE(bench.stage.reason() == ForceReason::kWorldLate);
  bench.input.peer = PeerState::kLost;
  for (int k = 1; k < 80; ++k) {
    REQUIRE((bench.Step(kPush) - (1 - k / 80.0) * kPush).norm() < 1e-12);
    REQUIRE(bench.stage.reason() == ForceReason::kWorldLost);
    REQUIRE_FALSE(bench.stage.is_zero());
  }
  bench.Run(2, kPush);
  REQUIRE(bench.stage.is_zero());
  for (const PeerState peer : {PeerState::kAbsent, PeerState::kWaiting, PeerState::kIncompatible}) {
    bench.input.peer = peer;
    REQUIRE(bench.Step(kPush).isZero(0));
    REQUIRE(bench.stage.reason() == ForceReason::kWorldAbsent);
  }
  bench.input.peer = PeerState::kLive;
  REQUIRE(bench.Step(kPush).norm() == Approx(kPush.norm() / 200));  // and it comes back softly
}

TEST_CASE("every fault takes the force away within cap/slew and gives it back softly") {
  Bench bench;
  bench.Run(300, 2 * kPush);
  ForceReason expected = ForceReason::kContact;
  Vec3 wanted = 2 * kPush;
  const SafetyInput sound = bench.input;
  SECTION("device") {
    bench.input.device_ok = bench.input.sample_finite = false;
    expected = ForceReason::kDeviceFault;
  }
  SECTION("sample") {
    bench.input.sample_finite = false;
    expected = ForceReason::kNotFinite;
  }
  SECTION("result") {
    wanted.y() = std::numeric_limits<double>::infinity();
    expected = ForceReason::kNotFinite;
  }
  SECTION("speed") {
    bench.input.speed = 3.001;
    expected = ForceReason::kOverSpeed;
  }
  SECTION("speed that is none") {
    bench.input.speed = std::nan("");
    expected = ForceReason::kOverSpeed;
  }
  SECTION("deadlines") {
    bench.input.missed = 20;
    expected = ForceReason::kLoopFault;
  }
  Vec3 before = 2 * kPush;
  for (int k = 0; k < 2; ++k) {
    const Vec3 force = bench.Step(wanted);
    REQUIRE((force - before).norm() <= 5);
    REQUIRE(bench.stage.reason() == expected);
    before = force;
  }
  REQUIRE(bench.stage.is_zero());  // 7.5 N at 5 N a tick
  bench.input = sound;
  REQUIRE(bench.Step(2 * kPush).norm() == Approx(2 * kPush.norm() / 200));
  REQUIRE(bench.stage.reason() == ForceReason::kSoftStart);
}

TEST_CASE("missed deadlines are a fault only in a row") {
  Bench bench;
  bench.Run(300, kPush);
  for (int k = 0; k < 100; ++k) {
    bench.input.missed = k % 2 == 0 ? 19 : 0;
    bench.Step(kPush);
    REQUIRE(bench.stage.reason() == ForceReason::kContact);
  }
  bench.input.missed = 1;
  for (int k = 0; k < 19; ++k) bench.Step(kPush);
  REQUIRE(bench.stage.reason() == ForceReason::kContact);
  bench.Step(kPush);
  REQUIRE(bench.stage.reason() == ForceReason::kLoopFault);
}

TEST_CASE("a contact without a channel is named") {
  Bench bench;
  bench.Run(300, Vec3::Zero());
  bench.input.no_channel = true;
  REQUIRE(bench.Step(Vec3::Zero()).isZero(0));
  REQUIRE(bench.stage.reason() == ForceReason::kNoChannel);
}

TEST_CASE("whatever comes, the command is finite, capped and slew-limited") {
  std::mt19937_64 random(31);
  Bench bench;
  const double values[] = {0, 1, -1, 9.9, 1e9, -1e200, 1.7e308, 1e-310, std::nan(""), INFINITY};
  const auto any = [&] { return values[random() % std::size(values)]; };
  Vec3 before = Vec3::Zero();
  for (int k = 0; k < 200'000; ++k) {
    bench.input.device_ok = random() % 50 != 0;
    bench.input.sample_finite = random() % 50 != 0;
    bench.input.speed = random() % 50 == 0 ? any() : 0.1;
    bench.input.peer = static_cast<PeerState>(random() % 400 < 390 ? 2 : random() % 6);
    bench.input.previous_duration_ns = static_cast<std::int64_t>(random() % 2'000'000);
    bench.input.missed = random() % 100 == 0 ? static_cast<std::int64_t>(random() % 40) : 0;
    const Vec3 force = bench.Step({any(), any(), any()});
    REQUIRE(force.allFinite());
    REQUIRE(force.norm() <= 10);
    REQUIRE((force - before).norm() <= 5);
    before = force;
  }
}

TEST_CASE("the stated bound is the sum of its parts") {
  const Settings settings;
  // max(5 x 50, 250) + 80 + 10/5000 s + three ticks
  REQUIRE(ZeroForceAfter(settings, 50'000'000) == 335'000'000);
  REQUIRE(ZeroForceAfter(settings, 100'000'000) == 585'000'000);
  REQUIRE(ZeroForceAfter(settings, 100'000'000'000) == 1'085'000'000);
}

}  // namespace
}  // namespace rikiseki::haptic
