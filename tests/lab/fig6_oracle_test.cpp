// SPDX-License-Identifier: MIT
#include "tests/lab/fig6_oracle.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <string>

#include "tests/lab/study.h"
#include "tests/lab/table.h"

namespace rikiseki::lab {
namespace {

// Every row of the reference that has no local dynamics; at least `count` of them.
void CompareWithReference(const std::string& file, std::size_t count) {
  const Table table = Table::Load(std::string(RIKISEKI_SOURCE_DIR "/tests/data/") + file);
  std::size_t compared = 0;
  for (std::size_t i = 0; i < table.size(); ++i) {
    const Row row = table.row(i);
    const std::string method = row.Text("method");
    if (method.starts_with("local")) continue;
    oracle::Push push;
    push.poke = row.Text("scenario") == "P";
    push.rule = row.Text("world_rule") == "EX" ? oracle::Rule::kExact : oracle::Rule::kSemiImplicit;
    push.method = method == "conv"             ? oracle::Method::kPosition
                  : method == "impulse_interp" ? oracle::Method::kImpulseInterpolate
                  : method == "impulse_hold"   ? oracle::Method::kImpulseHold
                                               : oracle::Method::kImpulseExtrapolate;
    push.ticks_per_period = static_cast<int>(std::lround(row.Number("Tw_s", 0, 1) / 1e-3));
    push.stiffness = row.Number("kp", 0, 1e6);
    push.damping = row.Number("kd", 0, 1e3);
    push.mass = row.Number("M", 0, 1e3);
    push.friction = push.poke ? 0.1 : 0.3;
    push.phase = row.Integer("phase_ticks", 0, 1000);
    const oracle::Result result = oracle::Simulate(push);
    CAPTURE(i, method);
    const auto agrees = [&](const char* column, double got) {
      const std::string expected = row.Text(column);
      CHECK(std::abs(got - std::stod(expected)) <= 1e-9 + RoundingOf(expected));
    };
    agrees("x_final_m", result.position);
    agrees("Jtot_Ns", result.impulse);
    agrees("v_peak_world_m_s", result.peak_speed);
    ++compared;
  }
  CHECK(compared >= count);
}

}  // namespace

TEST_CASE("the oracle reproduces the reference pokes") {
  CompareWithReference("fig6_runs_P.csv", 40);
}

TEST_CASE("the oracle reproduces the reference pushes") {
  CompareWithReference("fig6_runs_H.csv", 20);
}

}  // namespace rikiseki::lab
