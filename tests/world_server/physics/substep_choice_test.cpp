// SPDX-License-Identifier: MIT
#include "world_server/physics/substep_choice.h"

#include <catch2/catch.hpp>
#include <cmath>

namespace rikiseki::world {
namespace {

constexpr double kSubstep = 1e-3;
constexpr double kWindow = 0.01;

}  // namespace

TEST_CASE("free flight takes the window, turning and braking bodies less") {
  GroupMotion flying{.awake = 1, .gravity = 9.81};
  CHECK(CoarseSubstep(flying, kSubstep, kWindow) == kWindow);
  flying.turning = 20;
  CHECK(CoarseSubstep(flying, kSubstep, kWindow) == Approx(0.1 / 20));
  flying.drag = 50;
  CHECK(CoarseSubstep(flying, kSubstep, kWindow) == Approx(0.05 / 50));
  flying.turning = 1e9;
  CHECK(CoarseSubstep(flying, kSubstep, kWindow) == kSubstep);
}

TEST_CASE("in contact a lone body bears 5 ms, a fast, a bouncing or a spinning one less") {
  GroupMotion lone{.awake = 1, .meets = true, .gravity = 9.81};
  CHECK(CoarseSubstep(lone, kSubstep, kWindow) == kWindow);  // at rest
  lone.speed = 0.1;
  CHECK(CoarseSubstep(lone, kSubstep, kWindow) == 5e-3);
  GroupMotion fast = lone;
  fast.crossing = 250;  // crosses its inner radius in 4 ms
  CHECK(CoarseSubstep(fast, kSubstep, kWindow) == Approx(2e-3));
  GroupMotion spinning = lone;
  spinning.turning = 2;
  CHECK(CoarseSubstep(spinning, kSubstep, kWindow) == Approx(2e-3));
  GroupMotion bouncing = lone;
  bouncing.rebounds = true;
  CHECK(CoarseSubstep(bouncing, kSubstep, kWindow) == kSubstep);
}

TEST_CASE("what is unequal is swept more often") {
  GroupMotion unequal{.awake = 2, .meets = true};
  CHECK(Sweeps(unequal) == 50);
  unequal.mass_ratio = 100;
  CHECK(Sweeps(unequal) == 200);
  unequal.mass_ratio = 1e12;
  CHECK(Sweeps(unequal) == 400);
}

TEST_CASE("stacks: 2 ms for 5 cm, as the root of the size, and shorter for ill-matched masses") {
  const GroupMotion pair{
      .awake = 2, .meets = true, .meets_moving = true, .smallest = 0.05, .gravity = 9.81};
  const double stack_s = 0.03 * std::sqrt(0.05 / 9.81);
  CHECK(stack_s == Approx(2.14e-3).epsilon(1e-3));
  CHECK(CoarseSubstep(pair, kSubstep, kWindow) == Approx(stack_s / 1.2));
  GroupMotion high = pair;
  high.awake = 40;
  CHECK(CoarseSubstep(high, kSubstep, kWindow) == Approx(stack_s / 2));
  // A push is stepped in the scene's substep, unless the bodies are too small for it.
  CHECK(PushedSubstep(pair, kSubstep) == kSubstep);
  GroupMotion small = pair;
  small.smallest = 0.05 / 16;
  CHECK(PushedSubstep(small, kSubstep) == Approx(stack_s / 4));
  GroupMotion unequal = pair;
  unequal.mass_ratio = 400;
  CHECK(PushedSubstep(unequal, kSubstep) == Approx(stack_s / 4));
  unequal.mass_ratio = 1e9;
  CHECK(PushedSubstep(unequal, kSubstep) == 1e-4);
  GroupMotion weightless = pair;
  weightless.gravity = 0;
  CHECK(PushedSubstep(weightless, kSubstep) == kSubstep);
}

}  // namespace rikiseki::world
