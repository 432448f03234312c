// SPDX-License-Identifier: MIT
#include "haptic_server/render/local_bodies.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <random>
#include <utility>
#include <vector>

namespace rikiseki::haptic {
namespace {

constexpr std::int64_t kPeriodNs = 1'000'000;
constexpr double kPeriod = 1e-3;
constexpr double kMass = 0.3;
constexpr double kMoment = 2e-4;

protocol::LocalBody Body(std::uint32_t body, const BodyState& state, double mass = kMass) {
  protocol::LocalBody local;
  local.body = body;
  local.generation = 1;
  local.mass = mass;
  const double moment = kMoment * mass / kMass;
  local.inertia = {moment, 0, 0, moment, 0, moment};
  local.position = ToArray(state.pose.position);
  local.orientation = ToArray(state.pose.orientation);
  local.velocity = ToArray(state.velocity);
  local.angular_velocity = ToArray(state.angular_velocity);
  return local;
}

void Add(protocol::WorldFrame& frame, const protocol::LocalBody& local) {
  frame.local_bodies[frame.local_body_count++] = local;
}

// A frame that acknowledges tick `acked` of epoch 5.
protocol::WorldFrame Frame(std::uint64_t acked, double period_s = 0.05) {
  protocol::WorldFrame frame;
  frame.period_ns = static_cast<std::uint64_t>(std::llround(period_s * 1e9));
  frame.acked_epoch = 5;
  frame.acked_tick = acked;
  frame.local_substep_ns = 1'000'000;
  return frame;
}

struct Tick {
  std::vector<BodyImpulse> impulses;
  double length_s = kPeriod;
};

// A free body with equal moments, advanced exactly through a tick: the truth that needs no code of ours.
void Advance(BodyState& state, std::uint32_t body, const Tick& tick) {
  for (const BodyImpulse& push : tick.impulses) {
    if (push.body != body) continue;
    state.velocity += push.impulse / kMass;
    state.angular_velocity +=
        (push.angular_impulse - state.pose.position.cross(push.impulse)) / kMoment;
  }
  state.pose.position += tick.length_s * state.velocity;
  const double angle = state.angular_velocity.norm() * tick.length_s;
  if (angle > 0) {
    state.pose.orientation = Quat(Eigen::AngleAxisd(angle, state.angular_velocity.normalized())) *
                             state.pose.orientation;
  }
}

// Ticks in which body 1 is pushed at random, and where that leaves it before every tick.
class RandomPush {
 public:
  RandomPush(unsigned seed, bool jitter) : random_(seed), jitter_(jitter) {
    states_.push_back({.pose = {.position = {0.1, -0.2, 0.05}}, .velocity = {0.2, 0.1, 0}});
  }

  const BodyState& Before(std::size_t tick) {
    while (states_.size() <= tick) {
      Tick next;
      if (jitter_) next.length_s *= 1 + 0.5 * any_(random_);
      const BodyState& now = states_.back();
      if (any_(random_) > -0.4) {
        const Vec3 impulse =
            3e-3 * Vec3(any_(random_), any_(random_), any_(random_)) - 1e-3 * now.velocity;
        const Vec3 point = now.pose.position + 0.03 * Vec3(any_(random_), any_(random_), 1);
        next.impulses.push_back({1, 1, impulse, point.cross(impulse)});
      }
      states_.push_back(now);
      haptic::Advance(states_.back(), 1, next);
      ticks_.push_back(next);
    }
    return states_[tick];
  }
  const Tick& At(std::size_t tick) {
    Before(tick + 1);
    return ticks_[tick];
  }

 private:
  std::mt19937 random_;
  std::uniform_real_distribution<double> any_{-1, 1};
  bool jitter_;
  std::vector<BodyState> states_;
  std::vector<Tick> ticks_;
};

// Four corners of a cube of 6 cm on a floor.
void PutOnFloor(protocol::LocalBody& local) {
  for (const double x : {-0.03, 0.03}) {
    for (const double y : {-0.03, 0.03}) {
      protocol::ContactPlane& contact = local.contacts[local.contact_count++];
      contact.other_body = 0;
      contact.point = {x, y, -0.03};
      contact.normal = {0, 0, 1};
      contact.friction = 0.3;
    }
  }
  local.acceleration = {0, 0, -9.81};
}

bool Finite(const BodyState& state) {
  return state.pose.position.allFinite() && state.velocity.allFinite() &&
         state.angular_velocity.allFinite() && state.pose.orientation.coeffs().allFinite();
}

}  // namespace

TEST_CASE(
    "frames of an exact world do not move the copy of a free body, at any period and latency") {
  for (const bool jitter : {false, true}) {
    for (const std::size_t period : {1, 5, 17, 50, 200}) {
      for (const std::size_t latency : {0, 1, 8, 25, 50, 200}) {
        RandomPush push(static_cast<unsigned>(period + 1000 * latency), jitter);
        LocalBodies copies(kPeriodNs, 512, 5, PositionRule::kSecondOrder);
        for (std::size_t k = 0; k < 1000; ++k) {
          if (k % period == 0 && k > latency) {
            protocol::WorldFrame frame =
                Frame(k - latency - 1, static_cast<double>(period) * kPeriod);
            Add(frame, Body(1, push.Before(k - latency)));
            copies.Receive(frame, k);
          }
          copies.Step(k, push.At(k).impulses, push.At(k).length_s);
          if (copies.reconciliation().frames == 0) continue;
          const BodyState* copy = copies.Find(1, 1);
          const BodyState& truth = push.Before(k + 1);
          REQUIRE(copy != nullptr);
          REQUIRE((copy->pose.position - truth.pose.position).norm() < 1e-12);
          REQUIRE(copy->pose.orientation.angularDistance(truth.pose.orientation) < 1e-10);
          REQUIRE((copy->velocity - truth.velocity).norm() < 1e-12);
        }
        CAPTURE(jitter, period, latency);
        CHECK(copies.reconciliation().largest_jump < 1e-12);
        CHECK(copies.reconciliation().frames >=
              (1000 - latency) / std::max<std::size_t>(period, 64) - 3);
      }
    }
  }
}

TEST_CASE("a frame that is off is a jump of what it is off by") {
  RandomPush push(1, false);
  LocalBodies copies(kPeriodNs, 512, 5, PositionRule::kSecondOrder);
  for (std::size_t k = 0; k < 300; ++k) {
    if (k % 50 == 30) {
      protocol::WorldFrame frame = Frame(k - 21);
      BodyState state = push.Before(k - 20);
      if (k == 230) state.pose.position += Vec3(3e-4, 4e-4, 0);
      Add(frame, Body(1, state));
      copies.Receive(frame, k);
    }
    copies.Step(k, push.At(k).impulses, kPeriod);
  }
  CHECK(copies.reconciliation().frames == 5);
  CHECK(copies.reconciliation().newest_jump == Approx(5e-4).epsilon(1e-6));  // and back again
  CHECK(copies.reconciliation().largest_jump == Approx(5e-4).epsilon(1e-6));
}

TEST_CASE("old frames are caught up with in the documented steps, before the next one") {
  for (const std::size_t period : {17, 50, 100}) {
    for (const std::size_t latency : {1, 7, 8, 50, 120, 200, 400}) {
      LocalBodies copies(kPeriodNs, 512, 5, PositionRule::kSecondOrder);
      const auto budget = std::max<std::size_t>(kReplayPerTick, 2 * latency / period + 2);
      const std::size_t needed = (latency + budget - 2) / (budget - 1);
      std::uint64_t caught = 0;
      CAPTURE(period, latency, budget);
      REQUIRE(needed < period);
      for (std::size_t k = 0; k < 1000; ++k) {
        const bool arrives = k % period == 0 && k > latency;
        if (arrives) {
          protocol::WorldFrame frame =
              Frame(k - latency - 1, static_cast<double>(period) * kPeriod);
          Add(frame, Body(1, {}));
          caught = copies.reconciliation().frames;
          copies.Receive(frame, k);
        }
        copies.Step(k, {}, kPeriod);
        if (k <= latency + 2 * period) continue;  // the first one has nothing to jump from
        const std::size_t steps = k % period + 1;
        REQUIRE(copies.reconciliation().frames == caught + (steps >= needed ? 1 : 0));
      }
    }
  }
}

TEST_CASE("frames that come faster than they can be caught up with do not starve the copies") {
  LocalBodies copies(kPeriodNs, 512, 5, PositionRule::kSecondOrder);
  RandomPush push(4, false);
  for (std::size_t k = 0; k < 1000; ++k) {
    if (k >= 200) {
      protocol::WorldFrame frame = Frame(k - 200, 1.0 / 60);
      Add(frame, Body(1, push.Before(k - 199)));
      copies.Receive(frame, k);
    }
    copies.Step(k, push.At(k).impulses, kPeriod);
  }
  CHECK(copies.reconciliation().frames > 30);
  CHECK(copies.reconciliation().largest_jump < 1e-12);
}

TEST_CASE("a body that comes in is shown at once where it goes, and is no jump") {
  LocalBodies copies(kPeriodNs, 512, 5, PositionRule::kSecondOrder);
  RandomPush push(9, false);
  for (std::size_t k = 0; k < 100; ++k) copies.Step(k, push.At(k).impulses, kPeriod);
  REQUIRE(copies.Find(1, 1) == nullptr);
  protocol::WorldFrame frame = Frame(69);
  const BodyState& seen = push.Before(70);
  Add(frame, Body(1, seen));
  copies.Receive(frame, 100);
  REQUIRE(copies.Find(1, 1) != nullptr);
  CHECK(copies.Find(1, 2) == nullptr);  // another generation is another body
  CHECK(copies.Find(2, 1) == nullptr);
  CHECK((copies.Find(1, 1)->pose.position - seen.pose.position - 0.03 * seen.velocity).norm() <
        1e-12);
  for (std::size_t k = 100; k < 110; ++k) copies.Step(k, push.At(k).impulses, kPeriod);
  CHECK((copies.Find(1, 1)->pose.position - push.Before(110).pose.position).norm() < 1e-12);
  CHECK(copies.reconciliation().frames == 0);
}

TEST_CASE("a body that the frame does not hold leaves when the frame is caught up with") {
  LocalBodies copies(kPeriodNs, 512, 5, PositionRule::kSecondOrder);
  protocol::WorldFrame both = Frame(0);
  Add(both, Body(1, {}));
  Add(both, Body(2, {}));
  copies.Step(0, {}, kPeriod);
  copies.Receive(both, 1);
  REQUIRE(copies.Find(1, 1) != nullptr);
  REQUIRE(copies.Find(2, 1) != nullptr);
  for (std::size_t k = 1; k < 50; ++k) copies.Step(k, {}, kPeriod);
  protocol::WorldFrame one = Frame(19);
  Add(one, Body(2, {}));
  copies.Receive(one, 50);
  CHECK(copies.Find(1, 1) != nullptr);
  for (std::size_t k = 50; k < 60; ++k) copies.Step(k, {}, kPeriod);
  CHECK(copies.Find(1, 1) == nullptr);
  CHECK(copies.Find(2, 1) != nullptr);
  copies.Receive(Frame(58), 60);
  CHECK(copies.Find(2, 1) == nullptr);
}

TEST_CASE(
    "frames of other epochs count from now, and of no tick we remember, they end the copies") {
  LocalBodies copies(kPeriodNs, 64, 5, PositionRule::kSecondOrder);
  const Tick push{{{1, 1, Vec3(0.3, 0, 0), Vec3::Zero()}}};
  for (std::size_t k = 0; k < 1000; ++k) copies.Step(k, push.impulses, kPeriod);
  const auto receive = [&](std::uint64_t epoch, std::uint64_t tick) {
    protocol::WorldFrame frame = Frame(tick);
    frame.acked_epoch = epoch;
    Add(frame, Body(1, {.pose = {.position = {0.5, 0, 0}}}));
    copies.Receive(frame, 1000);
    return copies.Find(1, 1);
  };
  for (const std::uint64_t epoch : {0, 4, 6}) {
    const BodyState* shown = receive(epoch, 990);
    REQUIRE(shown != nullptr);
    CHECK(shown->pose.position == Vec3(0.5, 0, 0));
  }
  REQUIRE(receive(5, 999) != nullptr);
  CHECK(copies.Find(1, 1)->pose.position == Vec3(0.5, 0, 0));
  CHECK(receive(5, 1000) == nullptr);
  CHECK(receive(5, ~std::uint64_t{0} - 1) == nullptr);
  CHECK(receive(5, 999 - 64) == nullptr);
  REQUIRE(receive(5, 999 - 63) != nullptr);
  for (std::size_t k = 1000; k < 1050; ++k) copies.Step(k, {}, kPeriod);
  // 63 kicks of 1 m/s, each at the start of its tick, then 50 ticks of flight.
  CHECK(copies.Find(1, 1)->velocity.x() == Approx(63).epsilon(1e-12));
  CHECK(copies.Find(1, 1)->pose.position.x() ==
        Approx(0.5 + kPeriod * (63 * 64 / 2 + 63 * 50)).epsilon(1e-12));
}

TEST_CASE("an epoch of 0 accepts all") {
  LocalBodies copies(kPeriodNs, 64, 0, PositionRule::kSecondOrder);
  const Tick push{{{1, 1, Vec3(0.3, 0, 0), Vec3::Zero()}}};
  copies.Step(0, {}, kPeriod);
  copies.Step(1, push.impulses, kPeriod);
  protocol::WorldFrame frame = Frame(0);
  frame.acked_epoch = 77;
  Add(frame, Body(1, {}));
  copies.Receive(frame, 2);
  copies.Step(2, {}, kPeriod);
  CHECK(copies.Find(1, 1)->velocity.x() == Approx(1));
}

TEST_CASE("a tick of no length kicks and moves nothing, and a very long one costs a bounded time") {
  LocalBodies copies(kPeriodNs, 64, 5, PositionRule::kSecondOrder);
  copies.Step(0, {}, kPeriod);
  protocol::WorldFrame frame = Frame(0);
  protocol::LocalBody local = Body(1, {.pose = {.position = {0, 0, -5e-5}}});
  PutOnFloor(local);
  for (protocol::ContactPlane& contact : std::span(local.contacts).first(4)) contact.gap = -5e-5;
  Add(frame, local);
  frame.local_substep_ns = 1'000;
  copies.Receive(frame, 1);
  const Tick push{{{1, 1, Vec3(0, 0, 0.3), Vec3::Zero()}}};
  copies.Step(1, push.impulses, 0);
  REQUIRE(copies.Find(1, 1) != nullptr);
  CHECK((copies.Find(1, 1)->velocity - Vec3(0, 0, 1)).norm() < 1e-12);
  CHECK(copies.Find(1, 1)->pose.position.z() == -5e-5);
  copies.Step(2, {}, 10);  // 1e7 substeps of the world
  REQUIRE(copies.Find(1, 1) != nullptr);
  CHECK(copies.Find(1, 1)->pose.position.z() < 0.051);
}

TEST_CASE("a tick is divided into no more substeps than eight whole ones of 0.1 ms") {
  for (const auto& [length_s, substep_s] : {std::pair(1e-3, 1e-4), std::pair(10.0, 10.0 / 80)}) {
    LocalBodies copies(kPeriodNs, 64, 5, PositionRule::kSemiImplicit);
    copies.Step(0, {}, kPeriod);
    protocol::WorldFrame frame = Frame(0);
    protocol::LocalBody local = Body(1, {});
    local.acceleration = {0, 0, -9.81};
    Add(frame, local);
    frame.local_substep_ns = 1'000;
    copies.Receive(frame, 1);
    copies.Step(1, {}, length_s);
    // The semi-implicit rule tells how long its steps are: g t (t + h) / 2.
    CHECK(copies.Find(1, 1)->pose.position.z() ==
          Approx(-9.81 / 2 * length_s * (length_s + substep_s)).epsilon(1e-9));
  }
}

TEST_CASE("two copies that touch push each other, and their contact is told once") {
  LocalBodies copies(kPeriodNs, 64, 5, PositionRule::kSecondOrder);
  copies.Step(0, {}, kPeriod);
  protocol::WorldFrame frame = Frame(0);
  const Quat turned(Eigen::AngleAxisd(M_PI / 2, Vec3::UnitZ()));
  protocol::LocalBody first = Body(1, {.velocity = {1, 0, 0}});
  protocol::ContactPlane& contact = first.contacts[first.contact_count++];
  contact.other_body = 2;
  contact.other_generation = 1;
  contact.point = {0.03, 0, 0};
  contact.normal = {-1, 0, 0};
  contact.gap = 0.01;
  Add(frame, first);
  Add(frame, Body(2, {.pose = {.position = {0.07, 0, 0}, .orientation = turned}}));
  copies.Receive(frame, 1);
  for (std::size_t k = 1; k < 101; ++k) copies.Step(k, {}, kPeriod);
  const BodyState& a = *copies.Find(1, 1);
  const BodyState& b = *copies.Find(2, 1);
  // Inelastic: both go on at half the speed from where they met, after 10 ms.
  CHECK((a.velocity - Vec3(0.5, 0, 0)).norm() < 1e-9);
  CHECK((b.velocity - Vec3(0.5, 0, 0)).norm() < 1e-9);
  CHECK(a.pose.position.x() == Approx(0.01 + 0.045).margin(1e-3));
  CHECK(b.pose.position.x() - a.pose.position.x() == Approx(0.06).margin(1e-6));
}

TEST_CASE("soft shares pass bit for bit") {
  LocalBodies copies(kPeriodNs, 64, 5, PositionRule::kSecondOrder);
  copies.Step(0, {}, kPeriod);
  protocol::WorldFrame frame = Frame(0);
  Add(frame, Body(1, {}));
  Add(frame, Body(2, {}, 1e-4));
  copies.Receive(frame, 1);
  // Point at the centre: k T^2/M + 2 d T/M = (0.002 + 0.004)/0.3 for body 1, 60 for body 2; body 3 has no copy.
  const auto share = [](std::uint32_t body) {
    return BodyShare{.body = body,
                     .generation = 1,
                     .force = Vec3(0.1, -1.7, 0.3),
                     .displacement = Vec3(0.1, -1.7, 0.3) / 2000,
                     .stiffness = 2000,
                     .damping = 2};
  };
  std::vector<BodyShare> shares = {share(1), share(2), share(3), share(1)};
  shares[3].displacement.setZero();
  copies.SolveStiff(shares);
  CHECK(shares[0].force == share(1).force);
  CHECK(shares[2].force == share(3).force);
  CHECK(shares[3].force == share(1).force);
  CHECK(shares[1].force.norm() < 0.2 * share(2).force.norm());
}

TEST_CASE("a share is stiff from k T^2/M + 2 d T/M = 1 on") {
  // 2000 N/m and 2 N s/m at 1 kHz: 6 g.
  for (const double mass : {0.0059, 0.0061}) {
    LocalBodies copies(kPeriodNs, 64, 5, PositionRule::kSecondOrder);
    copies.Step(0, {}, kPeriod);
    protocol::WorldFrame frame = Frame(0);
    Add(frame, Body(1, {}, mass));
    copies.Receive(frame, 1);
    BodyShare share{.body = 1,
                    .generation = 1,
                    .force = {0, 0, 2},
                    .displacement = {0, 0, 1e-3},
                    .stiffness = 2000,
                    .damping = 2};
    copies.SolveStiff(std::span(&share, 1));
    CHECK((share.force == Vec3(0, 0, 2)) == (mass > 0.006));
  }
}

TEST_CASE("stiff shares are the momentum that the copy gains against the held finger") {
  for (const double mass : {1e-5, 1e-4, 1e-3}) {
    for (const double stiffness : {2e3, 1e4}) {
      for (const double speed : {-0.3, 0.0, 0.05}) {
        LocalBodies copies(kPeriodNs, 64, 5, PositionRule::kSecondOrder);
        copies.Step(0, {}, kPeriod);
        protocol::WorldFrame frame = Frame(0);
        const Vec3 normal = Vec3(0.6, 0, 0.8);
        Add(frame, Body(1, {.velocity = speed * normal}, mass));
        copies.Receive(frame, 1);
        const double depth = 1e-3;
        BodyShare share{.body = 1,
                        .generation = 1,
                        .force = stiffness * depth * normal,
                        .displacement = depth * normal,
                        .stiffness = stiffness,
                        .damping = 2};
        copies.SolveStiff(std::span(&share, 1));
        const Vec3 impulse = -kPeriod * share.force;
        const BodyImpulse push{1, 1, impulse, Vec3::Zero()};
        copies.Step(1, std::span(&push, 1), kPeriod);
        // Backward Euler: the force is that of spring and damper after the tick.
        const double after = copies.Find(1, 1)->velocity.dot(normal);
        const double law = stiffness * (depth + kPeriod * after) + 2 * after;
        CAPTURE(mass, stiffness, speed);
        CHECK(share.force.dot(normal) == Approx(std::max(0.0, law)).epsilon(1e-9).margin(1e-9));
        CHECK(share.force.cross(normal).norm() < 1e-12);
      }
    }
  }
}

// A light body on a floor, the finger 1 mm in its top from the first tick on.
TEST_CASE("a light body pressed on the floor gives the force of a wall") {
  for (const double mass : {1e-5, 1e-4, 1e-3, 0.005}) {
    for (const double stiffness : {2e3, 1e4}) {
      LocalBodies copies(kPeriodNs, 64, 5, PositionRule::kSecondOrder);
      copies.Step(0, {}, kPeriod);
      protocol::WorldFrame frame = Frame(0);
      protocol::LocalBody local = Body(1, {}, mass);
      PutOnFloor(local);
      Add(frame, local);
      copies.Receive(frame, 1);
      const double finger = 0.029;
      double largest = 0;
      CAPTURE(mass, stiffness);
      for (std::size_t k = 1; k < 1000; ++k) {
        const BodyState* copy = copies.Find(1, 1);
        REQUIRE(copy != nullptr);
        const Vec3 normal = copy->pose.orientation * Vec3::UnitZ();
        const Vec3 top = copy->pose * Vec3(0, 0, 0.03);
        const double depth = std::max(0.0, (top - Vec3(0, 0, finger)).dot(normal));
        BodyShare share{.body = 1,
                        .generation = 1,
                        .force = stiffness * depth * normal,
                        .point = Vec3(0, 0, finger) + depth * normal,
                        .displacement = depth * normal,
                        .stiffness = stiffness,
                        .damping = 0};
        copies.SolveStiff(std::span(&share, 1));
        largest = std::max(largest, share.force.norm());
        const Vec3 impulse = -kPeriod * share.force;
        const BodyImpulse push{1, 1, impulse, share.point.cross(impulse)};
        copies.Step(k, std::span(&push, 1), kPeriod);
        if (k > 200) REQUIRE(share.force.norm() == Approx(stiffness * 1e-3).epsilon(1e-2));
      }
      CHECK(largest < 1.01 * stiffness * 1e-3);
      CHECK(copies.Find(1, 1)->pose.position.norm() < 1e-5);
    }
  }
}

TEST_CASE("whatever a frame holds, what is shown and felt is finite") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double inf = std::numeric_limits<double>::infinity();
  const std::vector<double> absurd = {nan,    inf,    -inf, 0,    -1,    1e300, -1e300,
                                      5e-324, 1e-300, 1e9,  1e-9, -1e-9, 1e15};
  std::mt19937 random(17);
  const auto below = [&](std::size_t n) {
    return std::uniform_int_distribution<std::size_t>(0, n - 1)(random);
  };
  int kept = 0;
  for (int trial = 0; trial < 3000; ++trial) {
    LocalBodies copies(kPeriodNs, 64, 5, PositionRule::kSecondOrder);
    for (std::size_t k = 0; k < 10; ++k) copies.Step(k, {}, kPeriod);
    protocol::WorldFrame frame = Frame(below(12));
    for (std::uint32_t i = 1; i <= 2; ++i) {
      protocol::LocalBody local = Body(i, {.pose = {.position = {0.05 * i, 0, 0}}});
      PutOnFloor(local);
      local.contacts[0].other_body = 3 - i;
      local.contacts[0].other_generation = 1;
      Add(frame, local);
    }
    protocol::LocalBody& hit = frame.local_bodies[below(2)];
    protocol::ContactPlane& contact = hit.contacts[below(4)];
    const double value = absurd[below(absurd.size())];
    switch (below(14)) {
      case 0:
        hit.mass = value;
        break;
      case 1:
        hit.inertia[below(6)] = value;
        break;
      case 2:
        hit.position[below(3)] = value;
        break;
      case 3:
        hit.orientation[below(4)] = value;
        break;
      case 4:
        hit.velocity[below(3)] = value;
        break;
      case 5:
        hit.angular_velocity[below(3)] = value;
        break;
      case 6:
        hit.acceleration[below(3)] = value;
        break;
      case 7:
        hit.angular_acceleration[below(3)] = value;
        break;
      case 8:
        contact.point[below(3)] = value;
        break;
      case 9:
        contact.normal[below(3)] = value;
        break;
      case 10:
        contact.gap = value;
        break;
      case 11:
        contact.friction = value;
        break;
      case 12:
        contact.impulse[below(3)] = value;
        break;
      default:
        contact.radius = value;
        break;
    }
    copies.Receive(frame, 10);
    for (std::size_t k = 10; k < 40; ++k) {
      std::vector<BodyShare> shares;
      for (std::uint32_t i = 1; i <= 2; ++i) {
        const BodyState* copy = copies.Find(i, 1);
        if (copy == nullptr) continue;
        REQUIRE(Finite(*copy));
        ++kept;
        shares.push_back({.body = i,
                          .generation = 1,
                          .force = {0, 0, 2},
                          .point = copy->pose * Vec3(0, 0, 0.03),
                          .displacement = {0, 0, 1e-3},
                          .stiffness = 2000,
                          .damping = 2});
      }
      copies.SolveStiff(shares);
      std::vector<BodyImpulse> pushes;
      for (const BodyShare& share : shares) {
        REQUIRE(share.force.allFinite());
        REQUIRE(share.force.norm() < 1e6);
        const Vec3 impulse = -kPeriod * share.force;
        pushes.push_back({share.body, 1, impulse, share.point.cross(impulse)});
      }
      copies.Step(k, pushes, kPeriod);
    }
  }
  CHECK(kept > 20000);  // most of that is harmless
}

TEST_CASE("more bodies and contacts than there is room for are left out") {
  LocalBodies copies(kPeriodNs, 64, 5, PositionRule::kSecondOrder);
  copies.Step(0, {}, kPeriod);
  protocol::WorldFrame frame = Frame(0);
  for (std::uint32_t i = 0; i < protocol::kMaxLocalBodies; ++i) {
    protocol::LocalBody local = Body(i, {});
    local.contact_count = 1000;
    for (protocol::ContactPlane& contact : local.contacts) contact.normal = {0, 0, 1};
    Add(frame, local);
  }
  frame.local_body_count = 1000;
  copies.Receive(frame, 1);
  for (std::size_t k = 1; k < 20; ++k) copies.Step(k, {}, kPeriod);
  CHECK(copies.Find(0, 1) != nullptr);
}

}  // namespace rikiseki::haptic
