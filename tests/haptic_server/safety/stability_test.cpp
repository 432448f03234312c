// SPDX-License-Identifier: MIT
#include "haptic_server/safety/stability.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <iterator>

namespace rikiseki::haptic {
namespace {

TEST_CASE("the largest stable stiffness is that of the independent reference") {
  struct Row {
    double T, m, b, k_max;
  };
  // Computed independently of this project, from the discrete transition matrix: B = 0, no delay.
  const Row rows[] = {
      {0.000125, 0.02, 0.05, 800.04167}, {0.000125, 0.02, 5.0, 80418.841},
      {0.000125, 2.0, 0.05, 800.00042},  {0.00025, 0.1, 5.0, 40083.507},
      {0.001, 0.02, 0.5, 1004.1841},     {0.001, 0.02, 5.0, 10434.311},
      {0.001, 2.0, 5.0, 10004.168},      {0.002, 0.02, 5.0, 5452.4923},
      {0.002, 0.5, 0.5, 500.16672},      {0.01, 0.02, 0.5, 104.34311},
      {0.01, 0.02, 5.0, 1609.9196},      {0.01, 2.0, 5.0, 1004.1841},
  };
  for (const Row& row : rows) {
    CAPTURE(row.T, row.m, row.b);
    CHECK(LargestStableStiffness({row.m, row.b, row.T}, 0) == Approx(row.k_max).epsilon(1e-7));
  }
}

TEST_CASE("without a device damping it is the closed form in the wall's") {
  // K T^2/m < 2 beta (2 - beta)/(2 + beta), beta = B T/m
  for (const double beta : {0.01, 0.1, 0.5, 0.828, 1.5, 1.9}) {
    const double m = 0.05;
    const double T = 1e-3;
    CAPTURE(beta);
    CHECK(LargestStableStiffness({m, 0, T}, beta * m / T) * T * T / m ==
          Approx(2 * beta * (2 - beta) / (2 + beta)).epsilon(1e-7));
  }
  CHECK(LargestStableStiffness({0.05, 0, 1e-3}, 2.01 * 50) == 0);
}

TEST_CASE("a force that comes late bears less: whole and broken ticks") {
  // The best that any damping of the wall reaches without one of the device, in m/T^2: 0.686 in time,
  // 0.1445, 0.0624, 0.0348 one, two, three ticks late.
  const double m = 0.03;
  const double T = 1e-3;
  const auto best = [&](double late_ticks) {
    double most = 0;
    for (double beta = 0.002; beta < 1.5; beta += 0.002) {
      const HeldMass device{m, 0, T, late_ticks * T};
      most = std::max(most, LargestStableStiffness(device, beta * m / T) * T * T / m);
    }
    return most;
  };
  CHECK(best(1) == Approx(0.1445).epsilon(0.005));
  CHECK(best(2) == Approx(0.0624).epsilon(0.005));
  CHECK(best(3) == Approx(0.0348).epsilon(0.005));
  // Next to no latency is none; between two ticks it lies between theirs.
  const HeldMass in_time{m, 0.2, T};
  CHECK(LargestStableStiffness({m, 0.2, T, 1e-9}, 2) ==
        Approx(LargestStableStiffness(in_time, 2)).epsilon(1e-4));
  const double half_late = LargestStableStiffness({m, 0.2, T, T / 2}, 2);
  CHECK(half_late < LargestStableStiffness(in_time, 2));
  CHECK(half_late > LargestStableStiffness({m, 0.2, T, T}, 2));
  // The rule of Gil: K (T/2 + latency) = b + B, for little damping.
  CHECK(LargestStableStiffness({1, 0.2, T, 1.5 * T}, 0.3) == Approx(0.5 / (2 * T)).epsilon(0.01));
}

TEST_CASE("a SPIDAR alone bears what the notes say") {
  const HeldMass spidar{0.03, 0.2, 1e-3};
  CHECK(LargestStableStiffness(spidar, 0) == Approx(400).epsilon(0.01));
  CHECK(LargestStableStiffness(spidar, 2) == Approx(4100).epsilon(0.01));
  CHECK(LargestStableStiffness(spidar, 10) == Approx(14600).epsilon(0.01));
}

TEST_CASE("settings that the bare device does not bear are named, the shipped ones are fine") {
  Settings settings;
  CHECK(DeviceWarnings(settings).empty());
  settings.render.friction_stiffness_n_per_m = 5000;
  REQUIRE(DeviceWarnings(settings).size() == 1);
  CHECK_THAT(DeviceWarnings(settings)[0], Catch::Contains("render.friction_stiffness_n_per_m"));
  settings.render.friction_stiffness_n_per_m = 100;
  settings.render.stiffness_n_per_m = 5000;
  REQUIRE(DeviceWarnings(settings).size() == 1);
  CHECK_THAT(DeviceWarnings(settings)[0],
             Catch::Contains("render.stiffness_n_per_m is 5e+03 N/m at the device"));
  settings.mapping.force_scale = 0.5;  // the device feels half of stiffness and damping
  settings.render.stiffness_n_per_m = 2000;
  settings.render.damping_ns_per_m = 0;
  REQUIRE(DeviceWarnings(settings).size() == 1);
  settings.render.stiffness_n_per_m = 700;
  CHECK(DeviceWarnings(settings).empty());
  settings.mapping.motion_scale = 5;
  REQUIRE(DeviceWarnings(settings).size() == 1);
  settings = {};
  settings.safety.light_damping_ns_per_m = 16;
  REQUIRE(DeviceWarnings(settings).size() == 1);
  CHECK_THAT(DeviceWarnings(settings)[0], Catch::Contains("light_damping"));
  settings.spidar.moving_mass_kg = 0;  // nothing is known of the device
  CHECK(DeviceWarnings(settings).empty());
}

TEST_CASE("advice on the coupling follows the table of the paper's methods") {
  using protocol::Coupling;
  RenderSettings render;  // 2000 N/m, 2 N s/m, interpolated
  CHECK_THAT(CouplingAdvice(render, Coupling::kPosition, 0.05), Catch::Contains("below 1.25 kg"));
  CHECK_THAT(CouplingAdvice(render, Coupling::kImpulse, 0.05),
             Catch::Contains("bodies of any mass") && Catch::Contains("exceeds 50"));
  render.damping_ns_per_m = 51;
  CHECK_THAT(CouplingAdvice(render, Coupling::kImpulse, 0.05), Catch::Contains("below 1.2"));
  render.damping_ns_per_m = 2;
  render.display = DisplayRule::kHold;
  CHECK_THAT(CouplingAdvice(render, Coupling::kImpulse, 0.05), Catch::Contains("below 1.3 kg"));
  render.display = DisplayRule::kExtrapolate;
  CHECK_THAT(CouplingAdvice(render, Coupling::kImpulse, 0.05), Catch::Contains("below 2.5 kg"));
  CHECK(CouplingAdvice(render, Coupling::kLocal, 0.05).empty());
}

}  // namespace
}  // namespace rikiseki::haptic
