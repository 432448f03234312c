// SPDX-License-Identifier: MIT
#include "world_server/coupling/replay.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "tests/world_server/scenes.h"
#include "world_server/physics/bullet_world.h"
#include "world_server/physics/sliding_block.h"

namespace rikiseki::world {
namespace {

constexpr double kMass = 0.5;
constexpr double kMoment = kMass * 0.06 * 0.06 / 6;
constexpr double kTick = 1e-3;
constexpr double kNoCap = 1e6;

void AddTick(Replay& replay, double length_s, const std::vector<ReplayImpulse>& impulses = {},
             std::uint64_t ticks = 1) {
  replay.impulses.insert(replay.impulses.end(), impulses.begin(), impulses.end());
  replay.ticks.push_back({length_s, ticks, replay.impulses.size()});
}

// Notes what it is told to do; its one body stays.
class Recorder final : public DynamicsWorld {
 public:
  std::size_t body_count() const override { return 1; }
  BodyState State(std::size_t) const override { return {}; }
  void SetState(std::size_t, const BodyState&) override {}
  void ApplyAndStep(std::span<const Kick> kicks, double period_s) override {
    ++calls;
    for (const Kick& kick : kicks) {
      impulse += kick.impulse;
      largest = std::max(largest, kick.impulse.norm());
    }
    // J in effect during this step, as the kick comes at its start.
    moment += period_s * impulse;
    time_s += period_s;
  }
  bool FindContacts(std::size_t, double, std::vector<ContactSite>&) const override { return false; }

  int calls = 0;
  double time_s = 0;
  double largest = 0;
  Vec3 impulse = Vec3::Zero();
  Vec3 moment = Vec3::Zero();
};

}  // namespace

TEST_CASE("a free body moves tick by tick as J, L and S say, jittered ticks or not") {
  for (const bool jitter : {false, true}) {
    std::mt19937 random(jitter ? 1 : 2);
    std::uniform_real_distribution<double> any(-1, 1);
    BulletWorld world(test::FreeCube(kMass), 0.005);
    BodyState exact = world.State(0);
    Vec3 total = Vec3::Zero();
    Vec3 first_moment = Vec3::Zero();
    for (int period = 0; period < 20; ++period) {
      Replay replay;
      double covered = 0;
      for (int k = 0; k < 50; ++k) {
        const double length = kTick * (jitter ? 1 + 0.5 * any(random) : 1);
        covered += length;
        std::vector<ReplayImpulse> impulses;
        if (any(random) > 0) {
          const Vec3 impulse = 2e-3 * Vec3(any(random), any(random), any(random));
          const Vec3 point = exact.pose.position + 0.03 * Vec3(any(random), any(random), 1);
          const Vec3 angular = point.cross(impulse);
          exact.velocity += impulse / kMass;
          exact.angular_velocity += (angular - exact.pose.position.cross(impulse)) / kMoment;
          total += impulse;
          impulses.push_back({.body = 0, .impulse = impulse, .angular_impulse = angular});
        }
        first_moment += length * total;
        exact.pose.position += length * exact.velocity;
        const double angle = length * exact.angular_velocity.norm();
        if (angle > 0) {
          exact.pose.orientation =
              Quat(Eigen::AngleAxisd(angle, exact.angular_velocity.normalized())) *
              exact.pose.orientation;
        }
        AddTick(replay, length, impulses);
      }
      ReplayPush(replay, covered, kNoCap, world);
      const BodyState now = world.State(0);
      REQUIRE((now.velocity - total / kMass).norm() < 1e-12);
      REQUIRE((now.pose.position - first_moment / kMass).norm() < 1e-12);
      REQUIRE((now.angular_velocity - exact.angular_velocity).norm() < 1e-9);
      REQUIRE(now.pose.orientation.angularDistance(exact.pose.orientation) < 1e-9);
    }
  }
}

TEST_CASE("a sliding block without friction moves as J and S say") {
  SlidingBlock block(test::CubeOnFloor(1, 0.06, kMass), 0, SlideRule::kExact, kTick);
  Replay replay;
  double speed = 0;
  double position = 0;
  for (int k = 0; k < 50; ++k) {
    const double impulse = k % 3 == 0 ? 0.001 * k : 0;
    speed += impulse / kMass;
    position += kTick * speed;
    AddTick(replay, kTick, {{.body = 1, .impulse = {impulse, 0, 0}}});
  }
  ReplayPush(replay, 0.05, kNoCap, block);
  CHECK(block.State(1).velocity.x() == Approx(speed).epsilon(1e-12));
  CHECK(block.State(1).pose.position.x() == Approx(position).epsilon(1e-12));
}

TEST_CASE("a sliding block with friction is the same block, stepped tick by tick") {
  const Scene scene = test::CubeOnFloor(1, 0.06, kMass);
  SlidingBlock replayed(scene, 0.3, SlideRule::kExact);
  SlidingBlock stepped(scene, 0.3, SlideRule::kExact);
  Replay replay;
  for (int k = 0; k < 50; ++k) {
    const ReplayImpulse push{.body = 1, .impulse = {k < 20 ? 0.01 : 0, 0, 0}};
    AddTick(replay, kTick, k < 20 ? std::vector{push} : std::vector<ReplayImpulse>{});
    const Kick kick{.body = 1, .impulse = push.impulse};
    stepped.ApplyAndStep({&kick, 1}, kTick);
  }
  ReplayPush(replay, 0.05, kNoCap, replayed);
  CHECK(replayed.State(1).pose.position.x() ==
        Approx(stepped.State(1).pose.position.x()).epsilon(1e-9));
  CHECK(replayed.State(1).velocity.x() == Approx(stepped.State(1).velocity.x()).epsilon(1e-9));
}

TEST_CASE("substeps as long as a tick only where the finger pushed") {
  Recorder world;
  Replay replay;
  const std::vector<ReplayImpulse> push = {{.body = 0, .impulse = {1, 0, 0}}};
  for (int k = 0; k < 50; ++k)
    AddTick(replay, kTick, k == 10 || k == 11 ? push : std::vector<ReplayImpulse>{});
  ReplayPush(replay, 0.05, kNoCap, world);
  CHECK(world.calls == 4);  // 10 ms, two ticks, 38 ms
  CHECK(world.time_s == Approx(0.05).epsilon(1e-12));
  CHECK(world.moment.x() == Approx(kTick + 39 * 2 * kTick).epsilon(1e-12));
}

TEST_CASE(
    "what the ticks do not cover passes before them, where they cover more they are shortened") {
  const std::vector<ReplayImpulse> push = {{.body = 0, .impulse = {1, 0, 0}}};
  for (const double covered : {0.02, 0.05, 0.08}) {
    Recorder world;
    Replay replay;
    for (int k = 0; k < 10; ++k) AddTick(replay, covered / 10, push);
    ReplayPush(replay, 0.05, kNoCap, world);
    CHECK(world.time_s == Approx(0.05).epsilon(1e-12));
    CHECK(world.impulse.x() == Approx(10).epsilon(1e-12));
    CHECK(world.moment.x() == Approx(55 * std::min(covered, 0.05) / 10).epsilon(1e-12));
  }
}

TEST_CASE("without ticks, or with ticks of no length, the period passes and the impulse arrives") {
  Recorder world;
  ReplayPush({}, 0.05, kNoCap, world);
  CHECK(world.time_s == Approx(0.05).epsilon(1e-12));
  CHECK(world.impulse.isZero(0));
  Replay replay;
  AddTick(replay, 0, {{.body = 0, .impulse = {1, 2, 3}}});
  ReplayPush(replay, 0.05, kNoCap, world);
  CHECK(world.time_s == Approx(0.1).epsilon(1e-12));
  CHECK(world.impulse == Vec3(1, 2, 3));
}

TEST_CASE("lapped messages keep J exactly and the first moment to half a tick") {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> any(0, 1);
  for (const int lost : {1, 2, 3, 10, 50}) {
    for (int profile = 0; profile < 4; ++profile) {
      ReplayImpulse sum{.body = 0};
      for (int k = 0; k < lost; ++k) {
        // Constant, rising, falling, random: none needs a share beyond the cap.
        const double force = profile == 0   ? 1
                             : profile == 1 ? k
                             : profile == 2 ? lost - k
                                            : any(random);
        sum.impulse.x() += 1e-3 * force;
        sum.angular_impulse.z() += 1e-5 * force;
        sum.first_moment.x() += kTick * sum.impulse.x();
        sum.angular_first_moment.z() += kTick * sum.angular_impulse.z();
      }
      Recorder world;
      Replay replay;
      AddTick(replay, lost * kTick, {sum}, static_cast<std::uint64_t>(lost));
      ReplayPush(replay, lost * kTick, kNoCap, world);
      CAPTURE(lost, profile);
      CHECK(world.calls == lost);
      CHECK((world.impulse - sum.impulse).norm() < 1e-14);
      // Half a tick, and 1/n of it because the slope is that of a continuous line.
      CHECK(std::abs(world.moment.x() - sum.first_moment.x()) <=
            sum.impulse.x() * kTick / 2 * (1 + 1.0 / lost) + 1e-15);
      if (lost == 1) CHECK((world.moment - sum.first_moment).norm() < 1e-15);
    }
  }
}

TEST_CASE("hostile first moments do no more than the bound, and leave J") {
  const double inf = std::numeric_limits<double>::infinity();
  for (const double moment : {1e300, -1e300, 1e3, inf, -inf, std::nan("")}) {
    Recorder world;
    Replay replay;
    const ReplayImpulse push{.body = 0,
                             .impulse = {0.1, 0, 0},
                             .first_moment = {moment, -moment, 0},
                             .angular_first_moment = {moment, moment, moment}};
    AddTick(replay, 0.05, {push}, 50);
    ReplayPush(replay, 0.05, 2.0, world);
    CAPTURE(moment);
    CHECK(world.largest <= (2.0 + 0.1) / 50 * (1 + 1e-12));
    CHECK((world.impulse - push.impulse).norm() < 1e-12);
    CHECK(world.moment.norm() <= 0.05 * 2.1);
  }
}

TEST_CASE("absurd numbers of lost ticks cost no more than a step per 0.1 ms") {
  Recorder world;
  Replay replay;
  AddTick(replay, 0.05, {{.body = 0, .impulse = {0.1, 0, 0}}}, ~std::uint64_t{0});
  ReplayPush(replay, 0.05, kNoCap, world);
  CHECK(world.calls <= 501);
  CHECK(world.impulse.x() == Approx(0.1).epsilon(1e-12));
}

}  // namespace rikiseki::world
