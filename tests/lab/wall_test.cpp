// SPDX-License-Identifier: MIT
#include "tests/lab/wall.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <numbers>
#include <sstream>

#include "tests/lab/ideal_device.h"
#include "tests/lab/wall_run.h"

namespace rikiseki::lab {
namespace {

bool Full() {
  return std::getenv("RIKISEKI_FULL") != nullptr;
}

// Every n-th row of the reference.
Table ReferenceRows(std::size_t every) {
  const Table table = Table::Load(RIKISEKI_SOURCE_DIR "/tests/data/wall_kmax.csv");
  std::vector<std::size_t> indices;
  for (std::size_t i = 0; i < table.size(); i += every) indices.push_back(i);
  return table.Select(indices, {});
}

// b = 0, d = 0, numerics section 2: K T^2/m = 2 beta (2 - beta)/(2 + beta), beta = BT/m.
double UndampedLimit(double beta) {
  return 2 * beta * (2 - beta) / (2 + beta);
}

WallLoop Undamped(double beta, int delay) {
  return {.period_s = 1e-3,
          .mass_kg = 1,
          .damping_ns_per_m = 0,
          .wall_damping_ns_per_m = beta * 1e3,
          .delay_samples = delay};
}

// Speed out over speed in, of a mass that meets a wall.
double Restitution(double wall_damping, bool adhesion, double phase) {
  constexpr double kSpeed = 0.8;
  const WallSurface wall{.damping_ns_per_m = wall_damping, .adhesion = adhesion};
  const double period_s = wall.period_s;
  const double start = -(3 + phase) * kSpeed * period_s;
  IdealDevice device({[=](double t) { return Vec3(start + kSpeed * t, 0, 0); },
                      {.mass_kg = 0.13, .damping_ns_per_m = 0, .stiffness_n_per_m = 0}},
                     CoupledRun::StartNs(WallRun::HapticSettings(wall)));
  WallRun run(wall, device);
  // Half a period of sqrt(K/m) is 25 ms; the wall's impulse changes the momentum by what it is.
  for (int k = 0; k < 60; ++k) run.Tick();
  CHECK(run.force() == 0);
  return run.impulse() / (0.13 * kSpeed) - 1;
}

double MeanRestitution(double wall_damping, bool adhesion) {
  constexpr int kPhases = 25;
  double sum = 0;
  for (int i = 0; i < kPhases; ++i) sum += Restitution(wall_damping, adhesion, (i + 0.5) / kPhases);
  return sum / kPhases;
}

}  // namespace

TEST_CASE("the reference walls come out, and the shipped tick agrees on both sides of the limit") {
  const StudyResult result = RunStudy(Wall(), ReferenceRows(Full() ? 1 : 13), {.jobs = 2});
  CHECK(result.Count(RowStatus::kOk) == result.rows.size());
  std::size_t simulated = 0;
  for (std::size_t i = 0; i < result.rows.size(); ++i) {
    const double expected = ExpectedNumber(result.rows.row(i), "Kmax_eig_N_m");
    CHECK(result.outcomes[i].values[0] == Approx(expected).epsilon(1e-6));
    CHECK(result.outcomes[i].texts[0] != "0");
    simulated += result.outcomes[i].texts[0] == "1" ? 1 : 0;
  }
  CHECK(simulated > result.rows.size() / 4);
}

TEST_CASE("without damping in the device the limit has a closed form") {
  for (const double beta : {0.01, 0.1, 0.5, 0.83, 1.5, 1.9}) {
    CAPTURE(beta);
    CHECK(LargestStiffness(Undamped(beta, 0)) == Approx(1e6 * UndampedLimit(beta)).epsilon(1e-6));
  }
  CHECK(LargestStiffness(Undamped(0, 0)) == 0);
  CHECK(LargestStiffness(Undamped(2.1, 0)) == 0);
}

TEST_CASE("the stiffest possible wall loses a factor of three to five per sample of delay") {
  // numerics section 2: K T^2/m at the best wall damping.
  const double best[] = {0.686, 0.1445, 0.0624, 0.0348};
  for (int delay = 0; delay < 4; ++delay) {
    // The limit rises with the wall's damping and falls again: golden section.
    double low = 0.01;
    double high = 1.5 / (1 + delay);  // with too much of it nothing is stable
    double most = 0;
    const auto limit = [&](double beta) {
      const double kappa = 1e-6 * LargestStiffness(Undamped(beta, delay));
      most = std::max(most, kappa);
      return kappa;
    };
    while (high - low > 0.01) {
      const double left = high - 0.618 * (high - low);
      const double right = low + 0.618 * (high - low);
      if (limit(left) >= limit(right)) {  // both 0: beyond
        high = right;
      } else {
        low = left;
      }
    }
    CAPTURE(delay);
    CHECK(most == Approx(best[delay]).epsilon(2e-3));
  }
}

TEST_CASE("the device alone and with a hand are as stiff as numerics says") {
  const auto limit = [](double period_s, double mass, double damping, double wall_damping) {
    return LargestStiffness({.period_s = period_s,
                             .mass_kg = mass,
                             .damping_ns_per_m = damping,
                             .wall_damping_ns_per_m = wall_damping});
  };
  CHECK(limit(1e-3, 0.03, 0.2, 0) == Approx(400).epsilon(0.01));
  CHECK(limit(1e-3, 0.03, 0.2, 2) == Approx(4100).epsilon(0.01));
  CHECK(limit(1e-3, 0.03, 0.2, 10) == Approx(14'600).epsilon(0.01));
  CHECK(limit(1e-3, 0.58, 6.7, 0) == Approx(13'400).epsilon(0.01));
  CHECK(limit(1e-2, 0.58, 6.7, 0) == Approx(1370).epsilon(0.01));
}

TEST_CASE("the spectral radius is what a deviation grows by in the shipped tick") {
  const WallLoop loop{.period_s = 1e-3, .mass_kg = 0.1, .damping_ns_per_m = 1, .delay_samples = 1};
  const double limit = LargestStiffness(loop);
  CHECK(SpectralRadius(loop, 0.999 * limit) < 1);
  CHECK(SpectralRadius(loop, 1.001 * limit) > 1);
  CHECK(StaysInContact(loop, 0.97 * limit));
  CHECK_FALSE(StaysInContact(loop, 1.03 * limit));
}

TEST_CASE("the known rules") {
  const WallLoop loop{.period_s = 1e-3, .damping_ns_per_m = 3, .wall_damping_ns_per_m = 1};
  CHECK(LinearRule(loop) == Approx(8000));
  CHECK(PassivityBound(loop) == Approx(4000));
  CHECK(PassivityBound({.damping_ns_per_m = 1, .wall_damping_ns_per_m = 3}) == 0);
  CHECK(PassivityBound({.damping_ns_per_m = 1, .delay_samples = 1}) == 0);
  CHECK(LinearRule({.period_s = 1e-3, .damping_ns_per_m = 5, .delay_samples = 2}) == Approx(2000));
}

TEST_CASE("the zero-order hold returns too much, and B = KT/2 takes it back") {
  // numerics section 6, mean of 25 entry phases within a tick.
  CHECK(MeanRestitution(0, true) == Approx(1.1022).margin(0.001));
  CHECK(MeanRestitution(0, false) == Approx(1.1022).margin(0.001));
  CHECK(MeanRestitution(1, true) == Approx(1.0008).margin(0.001));
  CHECK(MeanRestitution(1, false) == Approx(1.0065).margin(0.001));
}

TEST_CASE("the books of a half-sine push are its impulse") {
  // 5 mm deep, 60 ms long at 2 kN/m: K e 2 T/pi = 0.381972 N s.
  constexpr double kDepth = 5e-3;
  constexpr double kLength = 60e-3;
  for (const double damping : {0.0, 2.0}) {  // the literal damper adds nothing in all
    const WallSurface wall{.damping_ns_per_m = damping};
    const auto program = [=](double t) {
      const double phase = t / kLength;
      return Vec3(phase < 1 ? kDepth * std::sin(std::numbers::pi * phase) : -1e-3, 0, 0);
    };
    IdealDevice device({program, {.mass_kg = 1e12, .damping_ns_per_m = 0, .stiffness_n_per_m = 0}},
                       CoupledRun::StartNs(WallRun::HapticSettings(wall)));
    WallRun run(wall, device);
    for (int k = 0; k < 70; ++k) run.Tick();
    CHECK(run.impulse() == Approx(0.381972).margin(1e-4));
  }
}

TEST_CASE("rows of walls that make no sense are refused") {
  const auto refusal = [](const std::string& row) -> std::string {
    std::istringstream in("T_s,m_kg,b_Ns_m,B_Ns_m,delay_samples,Kmax_eig_N_m\n" + row + "\n");
    try {
      RunStudy(Wall(), Table::Read(in, "t.csv"), {});
    } catch (const ConfigError& error) {
      return error.what();
    }
    return "";
  };
  CHECK(refusal("0.01,1,1,0,0,").empty());
  CHECK(refusal("0,1,1,0,0,").starts_with("t.csv:2: T_s = 0: "));
  CHECK(refusal("0.01,1,1,0,1.5,").starts_with("t.csv:2: delay_samples = 1.5: "));
  CHECK(refusal("0.01,1,1,0,0,much").starts_with("t.csv:2: Kmax_eig_N_m = much: "));
}

TEST_CASE("a missed stiffness is said, and no stable one may be written as 0 or nan") {
  const auto status = [](const std::string& row) {
    std::istringstream in("T_s,m_kg,b_Ns_m,B_Ns_m,delay_samples,Kmax_eig_N_m\n" + row + "\n");
    return RunStudy(Wall(), Table::Read(in, "t.csv"), {}).outcomes.at(0).status;
  };
  CHECK(status("0.001,1,0,100,0,180952.381") == RowStatus::kOk);
  CHECK(status("0.001,1,0,100,0,181000") == RowStatus::kMissed);
  CHECK(status("0.001,1,0,100,0,nan") == RowStatus::kMissed);
  CHECK(status("0.001,1,0,0,0,0") == RowStatus::kOk);
  CHECK(status("0.001,1,0,0,0,nan") == RowStatus::kOk);
  CHECK(status("0.001,1,0,0,0,10") == RowStatus::kMissed);
}

}  // namespace rikiseki::lab
