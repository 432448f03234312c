// SPDX-License-Identifier: MIT
// Settings that change while the loop runs: they lead the force to its new value and never step it.
#include <catch2/catch.hpp>

#include "tests/haptic_server/step_bench.h"

namespace rikiseki::haptic {
namespace {

TEST_CASE("settings that change in contact lead the force to its new value and never step it") {
  Bench bench;
  PressOn(bench);  // 2 mm deep
  Tuning tuning = TuningOf(bench.settings);
  double settled = 0;
  SECTION("stiffness") {
    tuning.stiffness_n_per_m = 500;
    settled = 1;
  }
  SECTION("cap") {
    tuning.force_cap_n = 3;
    settled = 3;
  }
  SECTION("cap and stiffness, both ways at once") {
    tuning.stiffness_n_per_m = 10000;
    tuning.force_cap_n = 3;
    settled = 3;
  }
  bench.step.Tune(tuning);
  Vec3 before = bench.device.force;
  for (int i = 0; i < 501; ++i) {
    bench.Run(1);
    // Linear over 500 ticks. The steepest is stiffness alone, from 2 to 10 kN/m at 2 mm: 16 N in 500
    // ticks; the cap meets it on the way.
    REQUIRE((bench.device.force - before).norm() <= 0.032 * (1 + 1e-9));
    before = bench.device.force;
  }
  CHECK(before.norm() == Approx(settled));
  CHECK(bench.message.stiffness == tuning.stiffness_n_per_m);
  CHECK(bench.message.force_cap == tuning.force_cap_n);
  CHECK(bench.step.health().energy.flagged == 0);
  CHECK(bench.Run(200).norm() == Approx(settled));
}

TEST_CASE("a second change goes on from where the first has come to") {
  Bench bench;
  PressOn(bench);
  Tuning tuning = TuningOf(bench.settings);
  tuning.stiffness_n_per_m = 1000;
  bench.step.Tune(tuning);
  bench.Run(250);
  CHECK(bench.message.stiffness == Approx(1500));
  tuning.stiffness_n_per_m = 2000;
  bench.step.Tune(tuning);
  bench.Run(1);
  CHECK(bench.message.stiffness == Approx(1501));
  bench.Run(500);
  CHECK(bench.message.stiffness == 2000);
}

TEST_CASE("the bound to zero force and the slew limit that are told follow the settings") {
  Bench bench;
  PressOn(bench);
  REQUIRE(bench.step.health().zero_force_after_ns == 335'000'000);
  Tuning tuning = TuningOf(bench.settings);
  tuning.fade_ms = 50;
  tuning.slew_limit_n_per_s = 10000;
  bench.step.Tune(tuning);
  bench.Run(501);
  // 30 ms less to fade, and from the cap to zero in 1 ms less.
  CHECK(bench.step.health().zero_force_after_ns == 304'000'000);
  CHECK(bench.step.health().slew_limit == 10000);
}

}  // namespace
}  // namespace rikiseki::haptic
