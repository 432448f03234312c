// SPDX-License-Identifier: MIT
#include "world_server/physics/push_budget.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <random>

namespace rikiseki::world {
namespace {

constexpr double kMass = 0.02;
constexpr double kTick = 1e-3;

BodyInertia Cube() {
  return BodyInertia::Of(kMass, Mat3(1.3e-6 * Mat3::Identity()));
}

double Kinetic(const BodyInertia& inertia, const BodyState& state) {
  return 0.5 * inertia.mass_kg * state.velocity.squaredNorm() +
         0.5 * state.angular_velocity.dot(inertia.inertia_B * state.angular_velocity);
}

void Push(PushBudget& budget, const BodyInertia& inertia, Kick kick, BodyState& state) {
  budget.Limit(inertia, state, kick);
  ApplyImpulse(inertia, kick.impulse, kick.angular_impulse, state);
}

}  // namespace

TEST_CASE("from rest a free body gets the finger's work, and no more") {
  const BodyInertia inertia = Cube();
  for (const double work_j : {0.0, 1e-6, 1e-3, 0.05, 10.0}) {
    BodyState state;
    PushBudget budget;
    budget.Grant({.work_j = work_j, .spring_j = 0}, state);
    for (int k = 0; k < 50; ++k) Push(budget, inertia, {.impulse = Vec3(4e-3, 0, 0)}, state);
    const double all = 50 * 4e-3;
    const double free_j = all * all / (2 * kMass);  // 1 J
    CHECK(Kinetic(inertia, state) == Approx(std::min(work_j, free_j)).margin(1e-15));
    CHECK(budget.refused().x() == Approx(all - kMass * state.velocity.x()).margin(1e-15));
  }
}

// The finger pushes with its spring; where it is, is the finger's: its work is force times way. An elastic blow sends
// the body off at twice the finger's speed.
TEST_CASE("pushed from rest by a finger that goes on, a body flies no faster than after a blow") {
  const BodyInertia inertia = Cube();
  constexpr double kSpeed = 0.2;
  BodyState state;
  PushBudget budget;
  budget.Grant({.work_j = 10.0 * 0.05 * kSpeed, .spring_j = 0}, state);  // 10 N for 50 ms
  for (int k = 0; k < 50; ++k) Push(budget, inertia, {.impulse = Vec3(10 * kTick, 0, 0)}, state);
  CHECK(Kinetic(inertia, state) <= 10.0 * 0.05 * kSpeed * (1 + 1e-12));
  const double taken = kMass * state.velocity.x();
  // Of what it took alone the work would have been taken * kSpeed.
  CHECK(taken * state.velocity.x() / 2 <= 0.1 * (1 + 1e-12));
}

TEST_CASE("a body that something holds takes all of the push, at no cost") {
  const BodyInertia inertia = Cube();
  BodyState held;
  PushBudget budget;
  budget.Grant({.work_j = 0, .spring_j = 4.0 * 4.0 / (2 * 2000)}, held);
  budget.Grant({.work_j = 4e-3, .spring_j = 4.0 * 4.0 / (2 * 2000)}, held);  // the finger came in
  for (int period = 0; period < 100; ++period) {
    for (int k = 0; k < 50; ++k) {
      Kick kick{.impulse = Vec3(0, 0, -4 * kTick)};
      budget.Limit(inertia, held, kick);
      REQUIRE(kick.impulse.z() == -4 * kTick);
    }
    REQUIRE(budget.refused().isZero(0));
    budget.Grant({.work_j = 0, .spring_j = 4.0 * 4.0 / (2 * 2000)}, held);
  }
}

TEST_CASE("what comes towards the finger is stopped, and pays for being sent back") {
  const BodyInertia inertia = Cube();
  BodyState state;
  state.velocity = Vec3(-1, 0, 0);
  PushBudget budget;
  budget.Grant({.work_j = 0, .spring_j = 0}, state);
  for (int k = 0; k < 50; ++k) Push(budget, inertia, {.impulse = Vec3(2e-3, 0, 0)}, state);
  CHECK(state.velocity.x() == Approx(1).epsilon(1e-9));  // elastically

  // Of a body that paid the finger's work already, nothing is left to go back with.
  state.velocity = Vec3(-1, 0, 0);
  PushBudget drained;
  drained.Grant({.work_j = -kMass / 2, .spring_j = 0}, state);
  for (int k = 0; k < 50; ++k) Push(drained, inertia, {.impulse = Vec3(2e-3, 0, 0)}, state);
  CHECK(std::abs(state.velocity.x()) < 0.05);  // a tick's kick is 0.1 m/s
}

TEST_CASE("what is left is kept as far as the spring holds it, what lacks is kept whole") {
  const BodyInertia inertia = Cube();
  BodyState state;
  PushBudget rich;
  rich.Grant({.work_j = 100, .spring_j = 0}, state);
  rich.Grant({.work_j = 0, .spring_j = 1e-3}, state);
  Push(rich, inertia, {.impulse = Vec3(1, 0, 0)}, state);
  CHECK(Kinetic(inertia, state) == Approx(1e-3));

  state = {};
  PushBudget poor;
  poor.Grant({.work_j = -5e-3, .spring_j = 1}, state);
  poor.Grant({.work_j = 6e-3, .spring_j = 1}, state);
  Push(poor, inertia, {.impulse = Vec3(1, 0, 0)}, state);
  CHECK(Kinetic(inertia, state) == Approx(1e-3));
}

TEST_CASE("whatever comes, a free body never has more than was granted") {
  std::mt19937 random(7);
  std::normal_distribution<double> any;
  const BodyInertia inertia = BodyInertia::Of(0.05, Mat3(Vec3(1e-5, 3e-5, 2e-5).asDiagonal()));
  for (int run = 0; run < 200; ++run) {
    BodyState state;
    PushBudget budget;
    double granted = 0;
    for (int period = 0; period < 20; ++period) {
      const double work_j = 1e-3 * any(random);
      granted += work_j;
      budget.Grant({.work_j = work_j, .spring_j = 1e9}, state);
      const double before = Kinetic(inertia, state);
      for (int k = 0; k < 10; ++k) {
        Push(budget, inertia,
             {.impulse = 2e-3 * Vec3(any(random), any(random), any(random)),
              .angular_impulse = 2e-5 * Vec3(any(random), any(random), any(random))},
             state);
        REQUIRE(Kinetic(inertia, state) <= std::max(before, granted) + 1e-12);
      }
    }
  }
}

TEST_CASE("with an overdraft a kick is charged afterwards, and lacking has an end") {
  const BodyInertia inertia = Cube();
  constexpr double kOverdraft = 0.05;
  BodyState held;
  PushBudget budget;
  budget.Grant({.overdraft_j = kOverdraft}, held);
  for (int k = 0; k < 100; ++k) {
    Kick kick{.impulse = Vec3(0, 0, -0.1)};  // 0.25 J of a free body, each
    budget.Limit(inertia, held, kick);
    REQUIRE(kick.impulse.z() == -0.1);
  }
  BodyState free;
  PushBudget other;
  other.Grant({.overdraft_j = kOverdraft}, free);
  for (int k = 0; k < 1000; ++k) Push(other, inertia, {.impulse = Vec3(1e-3, 0, 0)}, free);
  const double kick_j = 1e-3 * free.velocity.x() + 1e-6 / (2 * kMass);
  CHECK(Kinetic(inertia, free) >= kOverdraft);
  CHECK(Kinetic(inertia, free) <= kOverdraft + kick_j);
}

TEST_CASE("numbers that are none give nothing") {
  const BodyInertia inertia = Cube();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  BodyState state;
  PushBudget budget;
  budget.Grant({.work_j = nan, .spring_j = nan}, state);
  Kick kick{.impulse = Vec3(1, 0, 0)};
  budget.Limit(inertia, state, kick);
  CHECK(kick.impulse.isZero(0));
  budget.Grant({.work_j = 1, .spring_j = 0}, state);
  kick = {.impulse = Vec3(nan, 0, 0)};
  budget.Limit(inertia, state, kick);
  kick = {.impulse = Vec3(1e-3, 0, 0)};
  budget.Limit(inertia, state, kick);
  CHECK(kick.impulse.x() == 1e-3);
}

}  // namespace rikiseki::world
