// SPDX-License-Identifier: MIT
#include "tests/lab/fig6.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <random>
#include <sstream>
#include <string>

#include "tests/lab/fig6_oracle.h"

namespace rikiseki::lab {
namespace {

StudyResult RunReference(const std::string& file) {
  return RunStudy(Fig6(), Table::Load(RIKISEKI_SOURCE_DIR "/tests/data/" + file), {.jobs = 2});
}

void CheckAllMeet(const StudyResult& result, std::size_t rows) {
  CHECK(result.rows.size() == rows);
  CHECK(result.Count(RowStatus::kOk) == rows);
  for (std::size_t i = 0; i < result.rows.size(); ++i) {
    if (result.outcomes[i].status != RowStatus::kMissed) continue;
    const Row row = result.rows.row(i);
    CAPTURE(row.Text("method"), row.Text("phase_ticks"), row.Text("M"));
    CHECK(ToField(result.outcomes[i].values[0]) == row.Text("x_final_m"));
  }
}

oracle::Push ToOracle(const BlockPush& push) {
  oracle::Push same;
  same.poke = push.scenario == PushScenario::kPoke;
  same.rule =
      push.world == PushedWorld::kExactSlide ? oracle::Rule::kExact : oracle::Rule::kSemiImplicit;
  if (push.coupling == protocol::Coupling::kPosition) {
    same.method = oracle::Method::kPosition;
  } else if (push.display == haptic::DisplayRule::kInterpolate) {
    same.method = oracle::Method::kImpulseInterpolate;
  } else if (push.display == haptic::DisplayRule::kHold) {
    same.method = oracle::Method::kImpulseHold;
  } else {
    same.method = oracle::Method::kImpulseExtrapolate;
  }
  same.haptic_period = push.haptic_period_s;
  same.ticks_per_period = static_cast<int>(std::lround(push.world_period_s / push.haptic_period_s));
  same.stiffness = push.stiffness_n_per_m;
  same.damping = push.damping_ns_per_m;
  same.mass = push.mass_kg;
  same.friction = push.friction;
  same.phase = push.phase_ticks;
  return same;
}

// A push like those of the reference, anywhere in the range that the laboratory is meant for.
BlockPush RandomPush(std::mt19937_64& random) {
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  const auto pick = [&](int choices) {
    return std::uniform_int_distribution<int>(0, choices - 1)(random);
  };
  BlockPush push;
  push.scenario = pick(2) == 0 ? PushScenario::kPoke : PushScenario::kPush;
  push.friction = push.scenario == PushScenario::kPoke ? 0.1 : 0.3;
  push.world = pick(2) == 0 ? PushedWorld::kExactSlide : PushedWorld::kSemiImplicitSlide;
  const int method = pick(4);
  push.coupling = method == 0 ? protocol::Coupling::kPosition : protocol::Coupling::kImpulse;
  push.display = method == 2   ? haptic::DisplayRule::kHold
                 : method == 3 ? haptic::DisplayRule::kExtrapolate
                               : haptic::DisplayRule::kInterpolate;
  push.haptic_period_s = 0.5e-3 * (1 << pick(3));
  const int periods = 1 + pick(static_cast<int>(std::lround(0.2 / push.haptic_period_s)));
  const int least = static_cast<int>(std::ceil(0.005 / push.haptic_period_s));
  const int n = std::max(periods, least);
  push.world_period_s = n * push.haptic_period_s;
  push.mass_kg = std::exp(uniform(std::log(0.05), std::log(5)));
  push.stiffness_n_per_m = std::exp(uniform(std::log(200), std::log(5000)));
  push.damping_ns_per_m = pick(3) == 0 ? 0 : uniform(0, 20);
  push.phase_ticks = pick(n);
  return push;
}

}  // namespace

TEST_CASE("the reference pokes come out of the step functions that ship") {
  CheckAllMeet(RunReference("fig6_runs_P.csv"), 70);
}

TEST_CASE("the reference pushes come out of the step functions that ship") {
  CheckAllMeet(RunReference("fig6_runs_H.csv"), 35);
}

TEST_CASE("impulses take away most of the influence of the phase") {
  // numerics section 6: position/impulse >= 10 for P 0.5 kg, >= 3 for H 2 kg, at 50 ms.
  const auto spread = [](BlockPush push, protocol::Coupling coupling) {
    push.coupling = coupling;
    double least = 1e9;
    double most = -1e9;
    for (push.phase_ticks = 0; push.phase_ticks < 50; push.phase_ticks += 10) {
      const double x = SimulateBlockPush(push).final_position_m;
      least = std::min(least, x);
      most = std::max(most, x);
    }
    return most - least;
  };
  const BlockPush poke{.scenario = PushScenario::kPoke, .mass_kg = 0.5, .friction = 0.1};
  CHECK(spread(poke, protocol::Coupling::kPosition) >=
        10 * spread(poke, protocol::Coupling::kImpulse));
  const BlockPush slow{.scenario = PushScenario::kPush, .mass_kg = 2, .friction = 0.3};
  CHECK(spread(slow, protocol::Coupling::kPosition) >=
        3 * spread(slow, protocol::Coupling::kImpulse));
}

TEST_CASE("any push comes out as in the oracle") {
  // The tolerance is that of numerics section 6. Some loops are chaotic: they amplify what differs
  // by construction, rounding and the units in which impulses travel. There the bound is a multiple
  // of what the oracle itself makes of 1e-13 m.
  std::mt19937_64 random(20240607);
  constexpr int kPushes = 400;
  constexpr double kTolerance = 1e-9;   // m
  constexpr double kSensitive = 1e-10;  // m
  int sensitive = 0;
  for (int i = 0; i < kPushes; ++i) {
    const BlockPush push = RandomPush(random);
    oracle::Push same = ToOracle(push);
    const oracle::Result expected = oracle::Simulate(same);
    double moved = 0;
    for (const double offset : {-1e-13, 1e-13}) {
      same.face_offset = offset;
      moved = std::max(moved, std::abs(oracle::Simulate(same).position - expected.position));
    }
    const BlockPushResult got = SimulateBlockPush(push);
    CAPTURE(i, push.mass_kg, push.stiffness_n_per_m, push.damping_ns_per_m, push.world_period_s,
            push.haptic_period_s, push.phase_ticks, static_cast<int>(push.scenario),
            static_cast<int>(same.method), static_cast<int>(push.world), moved);
    if (moved > kSensitive) {
      ++sensitive;
      CHECK(std::abs(got.final_position_m - expected.position) <= 30 * moved);
    } else {
      CHECK(std::abs(got.final_position_m - expected.position) <= kTolerance);
      CHECK(std::abs(got.total_impulse_ns - expected.impulse) <= 1e-9);
      CHECK(std::abs(got.peak_speed_m_per_s - expected.peak_speed) <= 1e-8);
    }
  }
  CAPTURE(sensitive);
  CHECK(sensitive <= kPushes / 10);
}

TEST_CASE("impulses in whole units of 1e-12 N s cost far less than the tolerance") {
  // One unit is v = 1e-12/M, so x = v^2/(2 mu g) moves by v/(mu g) 1e-12/M: 8e-13 m for the poke of
  // 0.5 kg. The oracle knows no units.
  for (BlockPush push :
       {BlockPush{.scenario = PushScenario::kPoke, .mass_kg = 0.5, .friction = 0.1},
        BlockPush{.scenario = PushScenario::kPoke, .mass_kg = 2, .friction = 0.1},
        BlockPush{.scenario = PushScenario::kPush, .mass_kg = 2, .friction = 0.3}}) {
    for (push.phase_ticks = 0; push.phase_ticks < 50; push.phase_ticks += 10) {
      const double exact = oracle::Simulate(ToOracle(push)).position;
      CHECK(std::abs(SimulateBlockPush(push).final_position_m - exact) < 2e-12);
    }
  }
}

TEST_CASE("a push is repeatable to the bit") {
  const BlockPush push{.scenario = PushScenario::kPush, .mass_kg = 0.7, .friction = 0.3};
  const BlockPushResult a = SimulateBlockPush(push);
  const BlockPushResult b = SimulateBlockPush(push);
  CHECK(a.final_position_m == b.final_position_m);
  CHECK(a.total_impulse_ns == b.total_impulse_ns);
}

TEST_CASE("the engine slides a poked cube as far as its friction says") {
  // Phase 0: the whole impulse J falls within one world period, so the cube starts at J/M and stops
  // after v^2/(2 mu g), less v h/2 for the engine's substep of h = 1 ms.
  BlockPush push{.world = PushedWorld::kBullet, .mass_kg = 0.5};
  const BlockPushResult result = SimulateBlockPush(push);
  const double v = result.total_impulse_ns / push.mass_kg;
  const double expected = v * v / (2 * 0.1 * 9.81) - v * 0.5e-3;
  CHECK(result.final_position_m == Approx(expected).epsilon(0.01));
}

TEST_CASE("rows that make no sense are refused where they stand") {
  const auto refusal = [](const std::string& row) -> std::string {
    std::istringstream in("scenario,world_rule,Tw_s,kp,kd,M,method,phase_ticks,T_s\n" + row + "\n");
    try {
      RunStudy(Fig6(), Table::Read(in, "t.csv"), {});
    } catch (const ConfigError& error) {
      return error.what();
    }
    return "";
  };
  CHECK(refusal("P,EX,0.05,2000,0,1,local_M1,0,").empty());
  CHECK(refusal("Q,EX,0.05,2000,0,1,conv,0,").starts_with("t.csv:2: scenario = Q: P or H"));
  CHECK(refusal("P,XX,0.05,2000,0,1,conv,0,").starts_with("t.csv:2: world_rule = XX: "));
  CHECK(refusal("P,EX,0.05,2000,0,0,conv,0,").starts_with("t.csv:2: M = 0: a number from"));
  CHECK(refusal("P,EX,0.05,2000,0,1,conv,-1,").starts_with("t.csv:2: phase_ticks = -1: "));
  CHECK(refusal("P,EX,0.0505,2000,0,1,conv,0,").starts_with("t.csv:2: Tw_s = 0.0505: a whole"));
  // A third of a millisecond is no whole number of nanoseconds, so neither are three of them one.
  CHECK(refusal("P,EX,0.001,2000,0,1,conv,0,0.000333333333333333").starts_with("t.csv:2: Tw_s = "));
  CHECK(refusal("P,EX,0.05,2000,0,1,conv,0,0.0003").starts_with("t.csv:2: Tw_s = 0.05: a whole"));
}

}  // namespace rikiseki::lab
