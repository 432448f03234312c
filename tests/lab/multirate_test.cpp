// SPDX-License-Identifier: MIT
#include "tests/lab/multirate.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <random>
#include <sstream>

#include "haptic_server/render/local_bodies.h"
#include "tests/lab/multirate_loop.h"
#include "tests/lab/multirate_oracle.h"
#include "tests/lab/stable_masses.h"

namespace rikiseki::lab {
namespace {

bool Full() {
  return std::getenv("RIKISEKI_FULL") != nullptr;
}

Table Reference(const char* file, std::size_t every) {
  const Table table = Table::Load(std::string(RIKISEKI_SOURCE_DIR "/tests/data/") + file);
  std::vector<std::size_t> indices;
  for (std::size_t i = 0; i < table.size(); i += every) indices.push_back(i);
  return table.Select(indices, {});
}

void CheckAllMeet(const StudyResult& result) {
  CHECK(result.Count(RowStatus::kOk) == result.rows.size());
  for (std::size_t i = 0; i < result.rows.size(); ++i) {
    CAPTURE(i, result.rows.row(i).Find("method"), result.rows.row(i).Find("hand"));
    CHECK(result.outcomes[i].status == RowStatus::kOk);
  }
}

MultirateLoop Clamped(LoopMethod method, int ticks, double damping) {
  return {.method = method,
          .hand = {},
          .stiffness_n_per_m = 2000,
          .damping_ns_per_m = damping,
          .period_s = 0.05 / ticks,
          .ticks_per_period = ticks};
}

double Radius(const MultirateLoop& loop, double mass) {
  return PeriodMap(loop).SpectralRadius(mass);
}

double LeastStable(const MultirateLoop& loop) {
  const auto intervals = StableIntervals(PeriodMap(loop));
  if (intervals.empty() || intervals.back().to < kGreatestMass) return NAN;
  return intervals.back().from;
}

const haptic::Impedance kLight{0.13, 2.2, 50};
const haptic::Impedance kStiff{1.53, 30.2, 1000};

}  // namespace

TEST_CASE("the reference growths come out, to all digits that are written") {
  const StudyResult result =
      RunStudy(MultirateGrowth(), Reference("multirate_rho_samples.csv", 1), {.jobs = 2});
  CheckAllMeet(result);
  for (std::size_t i = 0; i < result.rows.size(); ++i) {
    for (std::size_t method = 0; method < kLoopMethodNames.size(); ++method) {
      const double expected = ExpectedNumber(result.rows.row(i), kLoopMethodNames[method]);
      if (expected < 1e-4) continue;  // dead within a period: rounding
      CAPTURE(i, kLoopMethodNames[method]);
      CHECK(result.outcomes[i].values[method] == Approx(expected).epsilon(1e-5));
    }
  }
}

TEST_CASE("the reference masses come out") {
  // Ten methods stand in turn, so every seventh row meets all of them.
  CheckAllMeet(
      RunStudy(MultirateMasses(), Reference("multirate_minmass.csv", Full() ? 1 : 7), {.jobs = 2}));
}

TEST_CASE("any loop grows as in the oracle, at any latency") {
  std::mt19937_64 random(20240909);
  const auto log_uniform = [&](double low, double high) {
    return std::exp(std::uniform_real_distribution<double>(std::log(low), std::log(high))(random));
  };
  for (int i = 0; i < (Full() ? 400 : 60); ++i) {
    oracle::Rates rates;
    rates.clamped = i % 10 == 0;
    rates.hand_mass = log_uniform(0.03, 2);
    rates.hand_damping = log_uniform(0.5, 30);
    rates.hand_stiffness = log_uniform(10, 2000);
    rates.stiffness = log_uniform(10, 20'000);
    rates.damping = i % 3 == 0 ? 0 : log_uniform(0.1, 20);
    rates.period = log_uniform(1e-4, 5e-3);
    rates.ticks = 1 + static_cast<int>(random() % 25);
    rates.latency = static_cast<int>(random() % static_cast<std::uint64_t>(2 * rates.ticks + 1));
    rates.mass = log_uniform(1e-3, 100);
    MultirateLoop loop{
        .hand = haptic::Impedance{rates.hand_mass, rates.hand_damping, rates.hand_stiffness},
        .stiffness_n_per_m = rates.stiffness,
        .damping_ns_per_m = rates.damping,
        .period_s = rates.period,
        .ticks_per_period = rates.ticks,
        .latency_ticks = rates.latency};
    if (rates.clamped) loop.hand.reset();
    for (const std::string_view name : kLoopMethodNames) {
      rates.method = name;
      loop.method = FindLoopMethod(name).value();
      const double expected = oracle::Growth(rates);
      CAPTURE(i, name, rates.ticks, rates.latency, rates.mass, expected);
      if (expected < 1e-3) continue;  // many numbers that die together are ill-conditioned:
      // two that do move by sqrt(rounding x the largest entry), 1e-5 for entries of 1e6.
      const double margin = 1e-5 + 1e-5 / expected;
      CHECK(std::log(Radius(loop, rates.mass)) == Approx(std::log(expected)).margin(margin));
    }
  }
}

TEST_CASE("a clamped finger has the limits of numerics section 3") {
  // Many ticks per period; kappa = k Tw^2/M, beta = k_d Tw/M.
  constexpr int kTicks = 200;
  const auto mass_of = [](double kappa) { return 2000 * 0.05 * 0.05 / kappa; };
  const auto stable = [&](LoopMethod method, double kappa, double damping = 0) {
    return Radius(Clamped(method, kTicks, damping), mass_of(kappa)) <= 1 + 1e-8;
  };
  CHECK(stable(LoopMethod::kPosition, 3.99));
  CHECK_FALSE(stable(LoopMethod::kPosition, 4.01));
  CHECK(stable(LoopMethod::kHold, 3.99));
  CHECK_FALSE(stable(LoopMethod::kHold, 4.01));
  CHECK(stable(LoopMethod::kExtrapolate, 1.98));
  CHECK_FALSE(stable(LoopMethod::kExtrapolate, 2.04));
  for (const double kappa : {1e-3, 0.1, 1.0, 3.0}) {
    CHECK_FALSE(stable(LoopMethod::kInterpolate, kappa));
  }
  // kappa/2 < beta < 2: above 50 N s/m at these rates, and above 1.25 kg.
  CHECK_FALSE(stable(LoopMethod::kInterpolate, 2, 45));
  CHECK(stable(LoopMethod::kInterpolate, 2, 55));
  CHECK_FALSE(stable(LoopMethod::kInterpolate, 4.5, 55));
  // kappa + 2 beta < 4 with the damper.
  const double damping = 20;
  const double mass = (2000 * 0.05 * 0.05 + 2 * damping * 0.05) / 4;
  CHECK(Radius(Clamped(LoopMethod::kHold, kTicks, damping), 1.01 * mass) <= 1);
  CHECK(Radius(Clamped(LoopMethod::kHold, kTicks, damping), 0.98 * mass) > 1);
}

TEST_CASE("consistent local dynamics has one least mass, for any world period and latency") {
  // numerics section 4: k T^2/4 + k_d T/2, for k_d >= (k T)^2/(16 b) or a clamped finger.
  struct Setting {
    LoopHand hand;
    double damping;
  };
  for (const Setting& setting : {Setting{std::nullopt, 0}, Setting{std::nullopt, 2},
                                 Setting{kLight, 2}, Setting{kStiff, 2}}) {
    const double least = 2000 * 1e-6 / 4 + setting.damping * 1e-3 / 2;
    for (const int ticks : {5, 50, 1000}) {
      for (const int latency : {0, ticks / 2, ticks, 2 * ticks}) {
        for (const LoopMethod method : {LoopMethod::kLocalReplay, LoopMethod::kLocalBlock}) {
          const PeriodMap map({.method = method,
                               .hand = setting.hand,
                               .damping_ns_per_m = setting.damping,
                               .ticks_per_period = ticks,
                               .latency_ticks = latency});
          CAPTURE(setting.damping, ticks, latency, static_cast<int>(method));
          CHECK(map.SpectralRadius(1.01 * least) <= 1 + 1e-8);
          CHECK(map.SpectralRadius(0.99 * least) > 1 + 1e-8);
          for (const double mass : {0.01, 1.0, 100.0}) {
            CHECK(map.SpectralRadius(mass) <= 1 + 1e-8);
          }
        }
      }
    }
  }
}

TEST_CASE("the implicit body step has no least mass") {
  for (const LoopHand& hand : {LoopHand(kLight), LoopHand(kStiff), LoopHand()}) {
    for (const double stiffness : {2e3, 1e4}) {
      if (hand && !(hand->damping_ns_per_m + 2 > stiffness * 1e-3 / 2))
        continue;  // the wall itself
      for (const int latency : {0, 50, 100}) {
        const PeriodMap map({.method = LoopMethod::kLocalImplicit,
                             .hand = hand,
                             .stiffness_n_per_m = stiffness,
                             .damping_ns_per_m = 2,
                             .latency_ticks = latency});
        for (double mass = 1e-5; mass < 1e4; mass *= 3) {
          CAPTURE(stiffness, latency, mass);
          CHECK(map.SpectralRadius(mass) <= 1 + 1e-8);
        }
      }
    }
  }
}

TEST_CASE("the table of numerics section 4: least stable masses, and where stability ends again") {
  const MultirateLoop medium{.method = LoopMethod::kPosition,
                             .hand = haptic::Impedance{0.58, 6.7, 135},
                             .damping_ns_per_m = 2};
  CHECK(LeastStable(medium) == Approx(2.56).epsilon(0.01));
  MultirateLoop firm = medium;
  firm.method = LoopMethod::kInterpolate;
  firm.hand = haptic::Impedance{0.93, 15.2, 500};
  const auto intervals = StableIntervals(PeriodMap(firm));
  REQUIRE(intervals.size() == 1);
  CHECK(intervals[0].from == Approx(1.31).epsilon(0.01));
  CHECK(intervals[0].to == Approx(31.5).epsilon(0.01));
}

TEST_CASE("stable intervals end where growth begins, and hold what is narrower than a step") {
  // Naive reconciliation: a comb of intervals, the narrowest 3 % wide.
  MultirateLoop loop{.method = LoopMethod::kLocalSemiImplicitWorld,
                     .hand = haptic::Impedance{1.53, 30.2, 1000},
                     .damping_ns_per_m = 2};
  const PeriodMap map(loop);
  const auto intervals = StableIntervals(map);
  CHECK(intervals.size() >= 8);
  for (std::size_t i = 0; i < intervals.size(); ++i) {
    const auto& [from, to] = intervals[i];
    CAPTURE(i, from, to);
    CHECK(map.SpectralRadius(from * (1 + 1e-6)) <= 1 + 1e-8);
    CHECK(map.SpectralRadius(from * (1 - 1e-6)) > 1);
    if (to == kGreatestMass) continue;
    CHECK(map.SpectralRadius(to * (1 - 1e-6)) <= 1 + 1e-8);
    CHECK(map.SpectralRadius(to * (1 + 1e-6)) > 1);
    if (i + 1 < intervals.size()) CHECK(to < intervals[i + 1].from);
  }
}

TEST_CASE("a stable interval far narrower than the scan is found") {
  // Growth dips to 1 between masses that are tried: 0.23332..0.23333 kg.
  const auto intervals = StableIntervals(PeriodMap({.method = LoopMethod::kLocalSemiImplicitWorld,
                                                    .hand = {},
                                                    .damping_ns_per_m = 2,
                                                    .ticks_per_period = 100}));
  CHECK(std::any_of(intervals.begin(), intervals.end(), [](const StableInterval& interval) {
    return interval.from > 0.233 && interval.to < 0.234;
  }));
}

TEST_CASE("a loop that leaves the range of numbers within a period grows by inf") {
  const MultirateLoop loop{.method = LoopMethod::kLocalReplay,
                           .hand = kLight,
                           .stiffness_n_per_m = 1e5,
                           .ticks_per_period = 300};
  CHECK(Radius(loop, 1e-5) == std::numeric_limits<double>::infinity());
  CHECK(StableIntervals(PeriodMap(loop)).empty());  // b < k T/2: the wall itself is unstable
}

TEST_CASE("the gains are those of the copy that ships") {
  constexpr double kPeriod = 1e-3;
  constexpr double kMass = 1e-3;  // so light that the copy is stepped implicitly
  constexpr double kStiffness = 2000;
  constexpr double kDamping = 2;
  const auto copy = [](double speed) {
    haptic::LocalBodies copies(1'000'000, 4, 0, PositionRule::kSemiImplicit);
    protocol::WorldFrame frame;
    frame.period_ns = 50'000'000;
    frame.local_substep_ns = 1'000'000;
    frame.local_body_count = 1;
    frame.local_bodies[0].mass = kMass;
    frame.local_bodies[0].velocity = {speed, 0, 0};
    copies.Receive(frame, 0);
    return copies;
  };
  const BodyGains body = ReadBodyStep(kMass, kPeriod);
  for (const auto& [speed, impulse] : {std::pair{0.3, 0.0}, std::pair{0.0, 0.02}}) {
    haptic::LocalBodies copies = copy(speed);
    const haptic::BodyImpulse push{.impulse = Vec3(impulse, 0, 0)};
    copies.Step(0, {&push, 1}, kPeriod);
    const BodyState& state = *copies.Find(0, 0);
    CHECK(state.pose.position.x() ==
          Approx(body.shift_per_speed * speed + body.shift_per_impulse * impulse).epsilon(1e-13));
    CHECK(state.velocity.x() == Approx(speed + body.speed_per_impulse * impulse).epsilon(1e-13));
  }
  const ImplicitGains gains = ReadImplicitStep(kStiffness, kDamping, kMass, kPeriod);
  for (const double speed : {0.0, -0.5, 0.2}) {
    const double depth = 1e-3;
    haptic::LocalBodies copies = copy(speed);
    haptic::BodyShare share{.force = Vec3(-kStiffness * depth, 0, 0),
                            .displacement = Vec3(-depth, 0, 0),
                            .stiffness = kStiffness,
                            .damping = kDamping};
    copies.SolveStiff({&share, 1});
    CHECK(-share.force.x() * kPeriod ==
          Approx(gains.per_depth * depth + gains.per_speed * speed).epsilon(1e-9));
  }
}

TEST_CASE("the displayed surface moves as the rules say") {
  const auto interpolated = ReadDisplay(haptic::DisplayRule::kInterpolate, 4);
  const auto extrapolated = ReadDisplay(haptic::DisplayRule::kExtrapolate, 4);
  const auto held = ReadDisplay(haptic::DisplayRule::kHold, 4);
  for (int j = 0; j < 4; ++j) {
    const auto i = static_cast<std::size_t>(j);
    CHECK(interpolated[i].previous == 1 - j / 4.0);
    CHECK(interpolated[i].last == j / 4.0);
    CHECK(extrapolated[i].previous == -j / 4.0);
    CHECK(extrapolated[i].last == 1 + j / 4.0);
    CHECK(held[i].previous == 0);
    CHECK(held[i].last == 1);
  }
}

TEST_CASE("rows of masses that make no sense are refused, and a hand may be given by its numbers") {
  const auto run = [](const std::string& row) -> std::string {
    std::istringstream in(
        "Tw_s,kp_N_m,kd_Ns_m,hand,method,frame_latency_ticks,M_min_kg,"
        "stable_intervals_kg_in_1e-5..1e4\n" +
        row + "\n");
    try {
      return std::string(StatusName(
          RunStudy(MultirateMasses(), Table::Read(in, "t.csv"), {}).outcomes.at(0).status));
    } catch (const ConfigError& error) {
      return error.what();
    }
  };
  const std::string end = "local_M1_implicit,0,1e-05,1e-05..inf";
  CHECK(run("0.005,2000,2,light," + end) == "ok");
  CHECK(run("0.005,2000,2,0.13 2.2 50," + end) == "ok");
  CHECK(run("0.005,2000,2,light,local_M1_implicit,0,0.001,") == "missed");
  CHECK(run("0.005,2000,2,light,local_M1_implicit,0,,1e-05..1;2..inf") == "missed");
  CHECK(run("0.005,2000,2,light,local_M1_implicit,0,nan,") == "missed");
  CHECK(run("0.005,2000,2,light,local_X,0,1e-05,") == "unsupported");
  CHECK(run("0.005,2000,2,heavy," + end).starts_with("t.csv:2: hand = heavy: finger, light"));
  CHECK(run("0.005,2000,2,1 2," + end).starts_with("t.csv:2: hand = 1 2: "));
  CHECK(run("0.0055,2000,2,light," + end).starts_with("t.csv:2: Tw_s = 0.0055: a whole"));
  CHECK(run("0.005,2000,2,light,conv,41,,").starts_with("t.csv:2: frame_latency_ticks = 41: "));
  CHECK(run("0.005,2000,2,light,conv,0,,0.1-1").starts_with("t.csv:2: stable_intervals"));
}

TEST_CASE("intervals agree although a coarser scan left out what is narrow") {
  const auto run = [](const std::string& least, const std::string& intervals) {
    std::istringstream in(
        "Tw_s,kp_N_m,kd_Ns_m,hand,method,M_min_kg,stable_intervals_kg_in_1e-5..1e4\n"
        "0.02,2000,2,clamped,local_SE," +
        least + "," + intervals + "\n");
    return RunStudy(MultirateMasses(), Table::Read(in, "t.csv"), {}).outcomes.at(0);
  };
  const Outcome whole = run("", "");
  const std::string text = whole.texts[0];
  CHECK(run(ToField(whole.values[0]), text).status == RowStatus::kOk);
  CHECK(run(ToField(1.2 * whole.values[0]), text).status == RowStatus::kMissed);
  // The last interval alone: the others are too far apart to be left out.
  CHECK(run("", text.substr(text.rfind(';') + 1)).status == RowStatus::kMissed);
}

TEST_CASE("growth is compared as its logarithm, 1 % and 2 % of it where that is small") {
  const auto status = [](const std::string& expected) {
    std::istringstream in("m,b,kh,kp,kd,T,n,M,L,local_AUTH\n0.2,4,100,1000,1,0.001,20,1,0," +
                          expected + "\n");
    return RunStudy(MultirateGrowth(), Table::Read(in, "t.csv"), {}).outcomes.at(0);
  };
  const double got = status("").values.at(8);
  REQUIRE(got > 0.9);
  REQUIRE(got < 1.5);
  CHECK(status(ToField(got * 1.009)).status == RowStatus::kOk);
  CHECK(status(ToField(got * 1.02)).status == RowStatus::kMissed);
  CHECK(status("inf").status == RowStatus::kMissed);
}

}  // namespace rikiseki::lab
