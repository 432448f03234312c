// SPDX-License-Identifier: MIT
// The engine's own error, as the report shows it.
#include "tests/lab/engine_error.h"

#include <catch2/catch.hpp>

#include "common/config.h"
#include "tests/lab/case_row.h"

namespace rikiseki::lab {
namespace {

test::RowResult Run(const std::string& row) {
  return test::RunText(EngineError(), "scenario,substep_s,bodies,mass_ratio\n" + row + "\n");
}

}  // namespace

TEST_CASE("engine-error: slide, spin and tumble come nearer to the truth with the substep") {
  for (const std::string scenario : {"slide", "spin", "tumble"}) {
    CAPTURE(scenario);
    const auto coarse = Run(scenario + ",0.005,,");
    const auto fine = Run(scenario + ",0.0005,,");
    CHECK(fine.status == RowStatus::kOk);
    CHECK(fine.got.at("cpu_s_per_s") > 0);
    // A slide is exact to rounding at any substep.
    const double nearer = scenario == "slide" ? 1e-9 : 0.3 * coarse.got.at("error");
    CHECK(fine.got.at("error") < nearer);
  }
  CHECK(Run("tumble,0.0005,,").got.at("error") < 1e-4);  // its integration is of second order
}

TEST_CASE("engine-error: a stack stands, with a heavy body on top too") {
  const auto even = Run("stack,0.001,3,1");
  const auto heavy = Run("stack,0.001,3,100");
  CHECK(even.status == RowStatus::kOk);
  CHECK(heavy.status == RowStatus::kOk);
  CHECK(even.got.at("error") < 1e-3);
  CHECK(heavy.got.at("error") < 1e-3);
}

TEST_CASE("engine-error refuses what it does not know") {
  CHECK_THROWS_AS(Run("fly,0.001,,"), ConfigError);
  CHECK_THROWS_AS(Run("stack,0.001,,1"), ConfigError);
}

}  // namespace rikiseki::lab
