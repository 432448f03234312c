// SPDX-License-Identifier: MIT
#include "tests/lab/extremes.h"

#include <catch2/catch.hpp>
#include <cstdlib>
#include <limits>
#include <sstream>

#include "tests/lab/extreme_run.h"
#include "tests/lab/outbound_check.h"

namespace rikiseki::lab {
namespace {

using protocol::Coupling;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
const haptic::Impedance kMediumHand{0.58, 6.7, 135};

// A tenth of the length unless RIKISEKI_FULL is set.
double Duration() {
  const char* full = std::getenv("RIKISEKI_FULL");
  return full != nullptr && std::string(full) == "1" ? 10 : 1;
}

void CheckSafe(const ExtremeRun& run) {
  const ExtremeResult result = SimulateExtreme(run);
  CHECK(result.complaint.empty());
  CHECK(result.sound);
  CHECK(result.force_finite);
  CHECK(result.largest_force_n <= result.force_cap_n);
  CHECK(result.largest_step_n <= result.step_limit_n * (1 + 1e-9));
  CHECK(result.largest_force_n > 0);  // there was a contact to be safe in
}

std::string Run(const std::string& text) {
  std::istringstream in(text);
  std::ostringstream out;
  const Case study = Extremes();
  WriteStudy(study, RunStudy(study, Table::Read(in, "t.csv"), {}), out);
  return out.str();
}

}  // namespace

TEST_CASE("the check of what leaves sees numbers that are none, in every message") {
  protocol::HapticTick tick;
  tick.period_ns = 1'000'000;
  protocol::HapticHealth haptic_health;
  haptic_health.period_ns = 1'000'000;
  protocol::WorldFrame frame;
  frame.frame = 7;
  frame.period_ns = 50'000'000;
  protocol::WorldHealth world_health;
  world_health.period_ns = 50'000'000;
  std::vector<protocol::Body> bodies(2);
  bodies[1].body = 1;
  OutboundCheck sound;
  sound.Look(tick, haptic_health);
  sound.Look(frame, world_health, bodies);
  CHECK(sound.complaint().empty());

  OutboundCheck of_tick;
  tick.stiffness = kNan;
  of_tick.Look(tick, haptic_health);
  CHECK_FALSE(of_tick.sound());
  OutboundCheck of_health;
  haptic_health.largest_force = std::numeric_limits<double>::infinity();
  of_health.Look({.period_ns = 1'000'000}, haptic_health);
  CHECK_FALSE(of_health.sound());
  OutboundCheck of_bodies;
  bodies[1].velocity[2] = kNan;
  of_bodies.Look(frame, world_health, bodies);
  CHECK(of_bodies.complaint() == "world.bodies 7: a value is not finite");
  OutboundCheck of_frame;
  frame.plane_count = 1;
  frame.planes[0].normal = {0, 0, 1};
  frame.planes[0].point[0] = kNan;
  of_frame.Look(frame, world_health, {});
  CHECK_FALSE(of_frame.sound());
}

TEST_CASE("whatever finger, sample or silence comes: sound, capped and slew-limited") {
  for (const ExtremeEvent event :
       {ExtremeEvent::kFast, ExtremeEvent::kFar, ExtremeEvent::kNotFinite, ExtremeEvent::kDenormal,
        ExtremeEvent::kSilence}) {
    for (const Coupling coupling : {Coupling::kPosition, Coupling::kImpulse, Coupling::kLocal}) {
      for (const double mass_kg : {1e-4, 1.0, 1e4}) {
        ExtremeRun run{.event = event, .coupling = coupling, .mass_kg = mass_kg};
        run.stiffness_n_per_m = mass_kg == 1 ? 1e5 : 2000;
        run.duration_s = event == ExtremeEvent::kSilence ? 8 : Duration();
        CAPTURE(static_cast<int>(event), static_cast<int>(coupling), mass_kg);
        CheckSafe(run);
      }
    }
  }
}

TEST_CASE("whatever the rates, masses and stiffnesses: sound, capped and slew-limited") {
  struct Rates {
    double haptic_hz, world_hz;
  };
  // n = 1; n = 1000; a period that is no multiple; a world faster than the haptic side; the corners.
  for (const Rates& rates : {Rates{200, 200}, Rates{1000, 1}, Rates{1000, 30}, Rates{100, 200},
                             Rates{8000, 200}, Rates{100, 1}}) {
    for (const Coupling coupling : {Coupling::kPosition, Coupling::kImpulse, Coupling::kLocal}) {
      for (const double mass_kg : {1e-4, 1e4}) {
        ExtremeRun run{.coupling = coupling,
                       .haptic_hz = rates.haptic_hz,
                       .world_hz = rates.world_hz,
                       .mass_kg = mass_kg,
                       .hand = kMediumHand,
                       .duration_s = Duration()};
        run.stiffness_n_per_m = mass_kg > 1 ? 10 : 1e5;
        CAPTURE(rates.haptic_hz, rates.world_hz, static_cast<int>(coupling), mass_kg);
        CheckSafe(run);
      }
    }
  }
}

TEST_CASE("an unstable contact is flagged, a stable one is not") {
  // The paper's own setting with a light block: far below its least mass. And a heavy one under
  // `local`.
  ExtremeRun run{
      .coupling = Coupling::kImpulse, .damping_ns_per_m = 2, .mass_kg = 0.1, .hand = kMediumHand};
  CHECK(SimulateExtreme(run).flagged);
  run.coupling = Coupling::kLocal;
  CHECK_FALSE(SimulateExtreme(run).flagged);
}

TEST_CASE("rows of extremes are read, computed and compared") {
  const std::string header = "event,coupling,haptic_hz,world_hz,kp,kd,M,hand,duration_s";
  const std::string out = Run(header + ",finite,cap_ok,slew_ok,flagged\n" +
                              "slot,local,1000,20,2000,2,1,medium,1,1,1,1,0\n" +
                              "nan,impulse,1000,20,2000,2,1,,1,1,1,1,1\n");
  CHECK(out.starts_with(
      header + ",finite,cap_ok,slew_ok,flagged,got_finite,got_cap_ok," +
      "got_slew_ok,got_flagged,got_growth,got_unstable,got_flag_ok,got_largest_force_n," +
      "got_largest_step_n,got_status\n"));
  CHECK(out.find(",0,1,1,1,0,") != std::string::npos);
  CHECK(out.find(",ok\n") != std::string::npos);
  CHECK(out.ends_with(",missed\n"));

  const auto refusal = [&](const std::string& row) -> std::string {
    try {
      Run(header + "\n" + row + "\n");
    } catch (const ConfigError& error) {
      return error.what();
    }
    return "";
  };
  CHECK(refusal("flood,local,1000,20,2000,2,1,medium,1").starts_with("t.csv:2: event = flood"));
  CHECK(refusal("slot,glue,1000,20,2000,2,1,medium,1").starts_with("t.csv:2: coupling = glue"));
  CHECK(refusal("slot,local,50,20,2000,2,1,medium,1").starts_with("t.csv:2: haptic_hz = 50"));
  CHECK(refusal("slot,local,1000,20,2000,2,1,fist,1").starts_with("t.csv:2: hand = fist"));
}

}  // namespace rikiseki::lab
