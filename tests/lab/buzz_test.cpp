// SPDX-License-Identifier: MIT
#include "tests/lab/buzz.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>
#include <sstream>
#include <string>

#include "tests/lab/buzz_run.h"

namespace rikiseki::lab {
namespace {

std::vector<double> Sine(double hz, double amplitude, std::size_t ticks) {
  std::vector<double> force;
  for (std::size_t i = 0; i < ticks; ++i) {
    force.push_back(3 + amplitude *
                            std::sin(2 * std::numbers::pi * hz * static_cast<double>(i) * 1e-3));
  }
  return force;
}

}  // namespace

TEST_CASE("what lies above 30 Hz is measured, and nothing below") {
  // Whole periods: exact. A sine of amplitude a has the mean square a^2/2, over a second.
  CHECK(EnergyAbove(Sine(50, 0.2, 1000)) == Approx(0.02).epsilon(1e-6));
  CHECK(EnergyAbove(Sine(20, 0.2, 1000)) < 1e-9);
  CHECK(RmsAbove(Sine(80, 0.2, 1000)) == Approx(0.2 / std::sqrt(2.0)).epsilon(1e-3));
  CHECK(RmsAbove(Sine(10, 0.2, 1000)) < 1e-6);

  std::vector<double> late(400, 0.0);
  late.resize(460, 1.0);
  const std::vector<double> touch = TouchOf(late);
  CHECK(touch.size() == 1000);
  CHECK(touch[49] == 0);
  CHECK(touch[50] == 1);
  CHECK(touch[110] == 0);
}

// Item 4 of issue 3 in virtual time, with 2 phases: the whole study is haptic_lab buzz.
TEST_CASE("`local` touches a cube of 20 g without buzzing at 60, 20 and 10 Hz") {
  const Case study = Buzz();
  const Table table = study.grid(/*quick=*/true);
  StudyResult result = RunStudy(study, table, {.jobs = 2});
  std::ostringstream said;
  study.summarise(result.rows, result.outcomes, said);
  INFO(said.str());
  CHECK(study.judge(result.rows, result.outcomes, said) == 0);
  CHECK(result.rows.size() == 12);
  for (const Outcome& outcome : result.outcomes) CHECK(outcome.values.back() > 1);  // N: it touched

  // The measure is no rubber stamp: `impulse` buzzes.
  BuzzRun buzzing{.touch = kPushTouch, .coupling = protocol::Coupling::kImpulse};
  const BuzzComparison got = CompareBuzz(buzzing, 2);
  CHECK(got.mean > 3 * got.single);
  result.outcomes[0].values[3] = 1.11;
  CHECK(study.judge(result.rows, result.outcomes, said) == 1);
}

TEST_CASE("rows of buzz are read and computed, and refused where they make no sense") {
  const Case study = Buzz();
  const auto run = [&study](const std::string& row) -> std::string {
    std::istringstream in("touch,coupling,Tw_s,phases,note\n" + row + "\n");
    std::ostringstream out;
    try {
      WriteStudy(study, RunStudy(study, Table::Read(in, "t.csv"), {}), out);
    } catch (const ConfigError& error) {
      return error.what();
    }
    return out.str();
  };
  const std::string done = run("poke,local,0.05,1,a");
  CHECK(done.starts_with(
      "touch,coupling,Tw_s,phases,note,got_single,got_mean,got_worst,got_ratio,got_worst_ratio,"
      "got_peak_n,got_status\npoke,local,0.05,1,a,"));
  CHECK(done.ends_with(",ok\n"));
  CHECK(run("stroke,local,0.05,1,").starts_with("t.csv:2: touch = stroke: one of push, "));
  CHECK(run("poke,single,0.05,1,").starts_with("t.csv:2: coupling = single: one of position, "));
  CHECK(run("poke,local,,1,").starts_with("t.csv:2: column Tw_s "));
}

}  // namespace rikiseki::lab
