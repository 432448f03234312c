// SPDX-License-Identifier: MIT
// Shapes other than cubes, light ones too, under a finger with coupling `local`: the copy moves as the
// world does, and nothing buzzes.
#include "tests/lab/pushed_shape.h"

#include <catch2/catch.hpp>
#include <cstdlib>
#include <vector>

#include "tests/lab/buzz_run.h"
#include "tests/lab/cube_push.h"

namespace rikiseki::lab {
namespace {

// All rates in the long form, the middle one of 20 Hz in the normal one.
std::vector<double> Periods(const std::vector<double>& all) {
  if (std::getenv("RIKISEKI_FULL") != nullptr) return all;
  return {0.05};
}

}  // namespace

// What slides comes to rest; what rolls rolls on until the run ends, up to a world period later than at a
// single rate. The bars of numerics section 5 for cubes.
TEST_CASE("`local` pushes every shape as far as a single rate does, and its copy jumps little") {
  for (const PushedShape shape : kPushedShapes) {
    const bool rolls = shape == PushedShape::kLyingCylinder || shape == PushedShape::kCapsule ||
                       shape == PushedShape::kEllipsoid;
    for (const PushScript script : {PushScript::kPush, PushScript::kPoke, PushScript::kPress}) {
      CubePush push{.script = script, .shape = shape, .mass_kg = 0.1, .damping_ns_per_m = 2};
      const PushResult single = SimulateCubePush(push, {});
      for (const double period_s : Periods({0.02, 0.05, 0.1})) {
        const PushStatistics local = SimulateCubePushes(
            push, {.coupling = protocol::Coupling::kLocal, .world_period_s = period_s}, 3);
        CAPTURE(NameOf(shape), static_cast<int>(script), period_s, single.displacement_m,
                local.displacement_mean_m, local.jump_max_m, single.force_peak_n,
                local.force_peak_n);
        // It rolls for 1.4 s or more of 1.5 s.
        const double more = rolls ? single.displacement_m / 1.4 * period_s : 0;
        CHECK(local.displacement_min_m > 0.99 * single.displacement_m - 1e-6);
        CHECK(local.displacement_max_m < 1.01 * single.displacement_m + more + 1e-6);
        CHECK(local.jump_max_m <= 2e-4);
        CHECK(local.force_peak_n == Approx(single.force_peak_n).epsilon(1e-3));
        const bool pressed = script == PushScript::kPress;
        CHECK((pressed ? single.force_mean_n > 3.9 : single.displacement_m > 0.01));
      }
    }
  }
}

TEST_CASE("20 g of any shape do not buzz under `local` at 60, 20 and 10 Hz") {
  for (const PushedShape shape : kPushedShapes) {
    for (const Touch& touch : {kPushTouch, kPokeTouch, kPressTouch}) {
      for (const double period_s : Periods({1.0 / 60, 0.05, 0.1})) {
        const BuzzRun run{.touch = touch,
                          .shape = shape,
                          .coupling = protocol::Coupling::kLocal,
                          .world_period_s = period_s};
        const BuzzComparison got = CompareBuzz(run, 2);
        const double bar = IsPress(touch) ? got.quiet_rms_n : 1.1 * got.single;
        CAPTURE(NameOf(shape), touch.name, period_s, got.single, got.mean, got.worst, got.peak_n);
        CHECK(got.mean <= bar);
        CHECK(got.peak_n > 1);
      }
    }
  }
}

}  // namespace rikiseki::lab
