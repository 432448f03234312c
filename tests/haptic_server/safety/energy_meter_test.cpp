// SPDX-License-Identifier: MIT
#include "haptic_server/safety/energy_meter.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "haptic_server/device/hand.h"
#include "haptic_server/safety/stability.h"

namespace rikiseki::haptic {
namespace {

constexpr double kPeriod = 1e-3;

Settings BareDevice(double mass = 0.03, double damping = 0.2) {
  Settings settings;
  settings.spidar.moving_mass_kg = mass;
  settings.spidar.friction_damping_ns_per_m = damping;
  return settings;
}

// A wall that fills x > 0, on the axis x. The test moves the finger.
struct Wall {
  Wall(const Settings& settings, double wall_stiffness)
      : meter(settings), stiffness(wall_stiffness) {}

  // The force on the user, held from now on.
  double Touch(double x, double velocity, bool brakes = false) {
    const double depth = std::max(0.0, x - face);
    meter.Measure({.position = Vec3(x, 0, 0),
                   .velocity = Vec3(velocity, 0, 0),
                   .duration_s = kPeriod,
                   .surface_work = force * (face - face_before),
                   .stored = stiffness * depth * depth / 2,
                   .penetration = depth});
    face_before = face;
    const double brake = brakes ? meter.Brake().x() : 0;
    force = -stiffness * depth + brake;
    meter.Displayed(Vec3(force, 0, 0), Vec3(brake, 0, 0), Vec3(-stiffness * depth, 0, 0));
    return force;
  }

  EnergyMeter meter;
  double stiffness;
  double face = 0;  // where the wall begins
  double face_before = 0;
  double force = 0;
};

TEST_CASE(
    "pressed and let go, a wall has given k/2 sum dx^2: the leak of the held force, exactly") {
  Wall wall(BareDevice(), 2000);
  double squares = 0;
  double depth = 0;
  double dissipated = 0;
  for (int k = 0; k <= 500; ++k) {
    const double next = 0.004 * std::sin(M_PI * k / 500);
    const double velocity = (next - depth) / kPeriod;
    if (k > 0) {
      squares += (next - depth) * (next - depth);
      dissipated += 0.2 * velocity * velocity * kPeriod;
    }
    depth = next;
    wall.Touch(depth, velocity);
  }
  CHECK(wall.meter.injected() == Approx(2000 * squares / 2).epsilon(1e-9));
  CHECK(wall.meter.dissipated() == Approx(dissipated).epsilon(1e-9));
}

TEST_CASE("a wall that pushes the hand away works by right, and is not blamed") {
  Wall wall(BareDevice(), 2000);
  wall.Touch(0.002, 0);
  double work = 0;
  for (int k = 1; k <= 100; ++k) {
    wall.face = -0.0005 * k;
    work += wall.force * -0.0005;
    wall.Touch(0.002 - 0.0005 * k, -0.5);
  }
  CHECK(work == Approx(0.2));  // 4 N over 5 cm
  CHECK(std::abs(wall.meter.injected()) < 1e-12);
}

// A mass that flies freely between touches and is drawn to the wall by a constant force.
struct Bouncing {
  Bouncing(double mass, double damping, double start_x, double start_v)
      : step(ExactStep({mass, damping, 0}, kPeriod)), x(start_x), v(start_v) {}
  void Advance(double force) {
    const double next = x + step.yv * v + step.yf * force;
    v = step.vv * v + step.vf * force;
    x = next;
  }
  ImpedanceStep step;
  double x, v;
};

TEST_CASE("a wall stiffer than the device bears is flagged, one that it bears is not") {
  const Settings settings = BareDevice();
  const double most = LargestStableStiffness({0.03, 0.2, kPeriod}, 0);
  for (const double fraction : {0.3, 0.8, 0.97, 3.0, 10.0, 60.0}) {
    CAPTURE(fraction);
    Wall wall(settings, fraction * most);
    Bouncing mass(0.03, 0.2, -0.002, 0.2);
    for (int k = 0; k < 5000; ++k) mass.Advance(wall.Touch(mass.x, mass.v) + 1);
    CHECK((wall.meter.times_flagged() > 0) == (fraction > 1));
  }
}

TEST_CASE(
    "a hand that presses deeper each time is no instability, though each release gives energy") {
  Wall wall(BareDevice(), 2000);
  double depth = 0;
  for (int press = 0; press < 8; ++press) {
    const double deepest = 0.003 + 0.001 * press;
    for (int k = 0; k < 600; ++k) {
      const double next = k < 400 ? deepest * std::sin(M_PI * k / 400) : -0.001;
      wall.Touch(next, (next - depth) / kPeriod);
      depth = next;
    }
  }
  CHECK(wall.meter.times_flagged() == 0);
}

// A wall that moves against a finger at rest, deeper by `growth` each time, at 4 Hz.
std::uint64_t FlagsOfOscillatingWall(double growth) {
  Wall wall(BareDevice(), 2000);
  double amplitude = 0.002;
  for (int cycle = 0; cycle < 8; ++cycle, amplitude *= growth) {
    for (int k = 0; k < 250; ++k) {
      wall.face = -amplitude * std::sin(2 * M_PI * k / 250.0);
      wall.Touch(0, 0);
    }
  }
  return wall.meter.times_flagged();
}

TEST_CASE("bodies that press deeper each time, driven by their coupling, are flagged") {
  CHECK(FlagsOfOscillatingWall(1.3) == 1);
  CHECK(FlagsOfOscillatingWall(0.95) == 0);
  CHECK(FlagsOfOscillatingWall(1) == 0);
}

// A finger at rest in a wall that comes and goes, `ticks` per cycle; once in each the split adds 2 mJ.
// The safety stage cuts the force at `cap`.
std::uint64_t FlagsOfSplit(double growth, int ticks, double world_period_s, double cap) {
  EnergyMeter meter(BareDevice());
  double amplitude = 0.002;
  double before = 0;
  double force = 0;
  for (int cycle = 0; cycle < 8; ++cycle, amplitude *= growth) {
    for (int k = 0; k < ticks; ++k) {
      const double depth = std::max(0.0, amplitude * std::sin(2 * M_PI * k / ticks));
      meter.Measure({.position = Vec3::Zero(),
                     .velocity = Vec3::Zero(),
                     .duration_s = kPeriod,
                     .surface_work = force * (before - depth),
                     .split_work = k == 0 ? 2e-3 : 0,
                     .stored = 2000 * depth * depth / 2,
                     .penetration = depth,
                     .world_period_s = world_period_s});
      before = depth;
      force = -std::min(cap, 2000 * depth);
      meter.Displayed(Vec3(force, 0, 0), Vec3::Zero(), Vec3(-2000 * depth, 0, 0));
    }
  }
  return meter.times_flagged();
}

TEST_CASE("what the split adds is no work of the bodies: where the peaks grow, it is flagged") {
  CHECK(FlagsOfSplit(1.05, 500, 0.05, 1e9) == 1);
  CHECK(FlagsOfSplit(0.95, 500, 0.05, 1e9) == 0);
}

TEST_CASE("the cap hides growth, so that peaks that are cut count as grown") {
  CHECK(FlagsOfSplit(0.95, 500, 0.05, 2) == 1);
  CHECK(FlagsOfSplit(0.95, 500, 0.05, 5) == 0);  // never cut
}

TEST_CASE("a cycle may take some periods of a slow world, and slower ones are a hand's") {
  CHECK(FlagsOfSplit(1.05, 4000, 0.05, 1e9) == 0);
  CHECK(FlagsOfSplit(1.05, 4000, 1, 1e9) > 0);
}

TEST_CASE("a body that is hurled away needs no peaks to be seen") {
  for (const double energy : {8.0, 12.0}) {
    CAPTURE(energy);
    Settings settings = BareDevice();
    settings.safety.force_cap_n = 10;
    EnergyMeter meter(settings);
    for (int k = 0; k < 1000; ++k) {
      // In ten frames of 20 ms, the window.
      meter.Measure(
          {.duration_s = kPeriod, .split_work = k % 20 == 0 && k < 200 ? energy / 10 : 0});
    }
    CHECK(meter.times_flagged() == (energy > 10 ? 1 : 0));
  }
}

TEST_CASE("the flag goes when the buzz is over, and is counted once") {
  Wall wall(BareDevice(), 4000);
  Bouncing mass(0.03, 0.2, -0.002, 0.2);
  for (int k = 0; k < 600; ++k) mass.Advance(wall.Touch(mass.x, mass.v) + 1);
  CHECK(wall.meter.unstable());
  for (int k = 0; k < 1500; ++k) wall.Touch(-0.01, 0);
  CHECK_FALSE(wall.meter.unstable());
  CHECK(wall.meter.times_flagged() == 1);
}

TEST_CASE("the controller takes the leak of the held force out of a bounce") {
  // Restitution of a held spring: exp(pi T sqrt(K/m)/4) = 1.102 at 2 kN/m, 0.13 kg.
  for (const bool brakes : {false, true}) {
    double sum = 0;
    for (int phase = 0; phase < 25; ++phase) {
      Wall wall(BareDevice(0.13, 0), 2000);
      Bouncing mass(0.13, 0, -0.0008 * (1 + phase / 25.0), 0.8);
      do {
        mass.Advance(wall.Touch(mass.x, mass.v, brakes));
      } while (mass.x > 0 || mass.v > 0);
      sum += -mass.v / 0.8;
    }
    if (brakes) {
      // B = KT/2 would make it 1.000; the brake follows the leak by a tick.
      CHECK(sum / 25 == Approx(1.0).margin(0.02));
    } else {
      CHECK(sum / 25 == Approx(1.1022).margin(0.001));
    }
  }
}

TEST_CASE("the controller lets a bare device rest on a wall that it could not bear") {
  Wall wall(BareDevice(), 4000);
  Bouncing mass(0.03, 0.2, -0.002, 0.2);
  double deepest = 0;
  for (int k = 0; k < 4000; ++k) {
    mass.Advance(wall.Touch(mass.x, mass.v, true) + 1);
    if (k >= 3000) deepest = std::max(deepest, std::abs(mass.x - 0.00025));
  }
  CHECK(deepest < 1e-4);
  CHECK(wall.meter.times_flagged() == 0);
}

TEST_CASE(
    "where nothing leaks, nothing is braked, and a brake never exceeds what the device bears") {
  Wall wall(BareDevice(), 2000);
  wall.Touch(-0.001, 1);
  CHECK(wall.meter.Brake().isZero(0));  // free
  wall.Touch(0.001, 1);
  wall.Touch(0.001, 0);
  CHECK(wall.meter.Brake().isZero(0));  // at rest
  Wall leaking(BareDevice(), 20000);
  leaking.Touch(0.001, 0.5);
  leaking.Touch(0.005, 0.5);
  CHECK(leaking.meter.Brake().x() == Approx(-0.5 * 0.5 * 0.03 / kPeriod));
  EnergyMeter massless(BareDevice(0, 0));
  massless.Measure({.penetration = 0.001});
  CHECK(massless.Brake().isZero(0));
}

TEST_CASE("a gap in the samples, and nonsense, cost nothing and count nothing") {
  EnergyMeter meter(BareDevice());
  meter.Measure({.position = Vec3(1, 0, 0), .duration_s = kPeriod});
  meter.Displayed(Vec3(-5, 0, 0), Vec3::Zero(), Vec3(-5, 0, 0));
  meter.Skip();
  meter.Measure({.position = Vec3(2, 0, 0), .duration_s = kPeriod});
  CHECK(meter.injected() == 0);
  meter.Displayed(Vec3(1e300, 0, 0), Vec3::Zero(), Vec3(1e300, 0, 0));
  meter.Measure({.position = Vec3(1e12, 0, 0), .velocity = Vec3(1e200, 0, 0), .duration_s = 1});
  CHECK(std::isfinite(meter.injected()));
  CHECK(std::isfinite(meter.dissipated()));
  CHECK(meter.Brake().allFinite());
}

}  // namespace
}  // namespace rikiseki::haptic
