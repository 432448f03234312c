// SPDX-License-Identifier: MIT
#include "world_server/physics/sliding_block.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <stdexcept>

#include "tests/world_server/scenes.h"

namespace rikiseki::world {
namespace {

constexpr double kFriction = 0.3;
constexpr double kDeceleration = kFriction * 9.81;

// Where the block comes to rest after an impulse, and how long it takes at most.
double Slide(SlideRule rule, double impulse_ns, double period_s) {
  SlidingBlock block(test::CubeOnFloor(1, 0.06, 2.0), kFriction, rule);
  const Kick kick{.body = 1, .impulse = {impulse_ns, 0, 0}};
  block.ApplyAndStep({&kick, 1}, period_s);
  for (int i = 0; i < 10000 && block.State(1).velocity.x() != 0; ++i)
    block.ApplyAndStep({}, period_s);
  REQUIRE(block.State(1).velocity.x() == 0);
  return block.State(1).pose.position.x();
}

}  // namespace

TEST_CASE("the exact rule stops after v^2 / (2 mu g), whatever the period") {
  for (const double period : {0.001, 0.02, 0.05, 0.1, 3.0}) {
    for (const double impulse : {2.0, -2.0, 0.01}) {
      const double v = impulse / 2.0;
      CHECK(Slide(SlideRule::kExact, impulse, period) ==
            Approx(v * std::abs(v) / (2 * kDeceleration)).epsilon(1e-12));
    }
  }
}

TEST_CASE("the semi-implicit rule stops about v Tw / 2 short") {
  // Sum over the periods of Tw (v - i d), d = mu g Tw: with v = N d it is d Tw N (N - 1) / 2, which
  // is v^2 / (2 mu g) - v Tw / 2.
  const double period = 0.05;
  const double v = 8 * kDeceleration * period;
  CHECK(Slide(SlideRule::kSemiImplicit, 2.0 * v, period) ==
        Approx(v * v / (2 * kDeceleration) - v * period / 2).epsilon(1e-12));
}

TEST_CASE("impulses add up, and only those of the block along x count") {
  SlidingBlock block(test::CubeOnFloor(1, 0.06, 2.0), kFriction, SlideRule::kExact);
  const std::vector<Kick> kicks = {{.body = 1, .impulse = {1, 5, 5}},
                                   {.body = 1, .impulse = {0.5, 0, 0}},
                                   {.body = 0, .impulse = {9, 0, 0}}};
  block.ApplyAndStep(kicks, 0);
  CHECK(block.State(1).velocity == Vec3(0.75, 0, 0));
  CHECK(block.State(1).pose.position == Vec3(0, 0, 0.03));
  CHECK(block.State(0).velocity == Vec3::Zero());
  CHECK(block.body_count() == 2);
}

TEST_CASE("a block without friction keeps its velocity") {
  SlidingBlock block(test::CubeOnFloor(1, 0.06, 2.0), 0, SlideRule::kExact);
  const Kick kick{.body = 1, .impulse = {1, 0, 0}};
  block.ApplyAndStep({&kick, 1}, 0.5);
  block.ApplyAndStep({}, 0.5);
  CHECK(block.State(1).velocity.x() == 0.5);
  CHECK(block.State(1).pose.position.x() == Approx(0.5).epsilon(1e-15));
}

TEST_CASE("a scene without exactly one moving body is refused") {
  Scene scene = test::CubeOnFloor(1);
  scene.bodies.push_back(scene.bodies[1]);
  CHECK_THROWS_AS(SlidingBlock(scene, 0.3, SlideRule::kExact), std::invalid_argument);
  scene.bodies.resize(1);
  CHECK_THROWS_AS(SlidingBlock(scene, 0.3, SlideRule::kExact), std::invalid_argument);
}

}  // namespace rikiseki::world
