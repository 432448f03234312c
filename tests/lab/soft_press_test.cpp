// SPDX-License-Identifier: MIT
// A soft block under the finger in both step functions, in virtual time: the force is that of the two
// springs in series, at any world rate, latency and coupling, and nothing buzzes.
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <numbers>

#include "haptic_server/device/hand.h"
#include "tests/lab/ideal_device.h"
#include "tests/lab/prescribed_device.h"
#include "tests/lab/soft_press_run.h"

namespace rikiseki::lab {
namespace {

void CheckBooks(const protocol::Books& books) {
  for (std::size_t i = 0; i < 3; ++i) {
    const auto pending = books.displayed[i] - books.covered[i] - books.peer_lost[i];
    const double pending_ns = static_cast<double>(pending) * protocol::kImpulseUnit;
    CHECK(std::abs(pending_ns) < 2);  // 4 N for the time of a frame and its way back
    CHECK(books.covered[i] == books.applied[i] + books.discarded[i]);
    CHECK(books.discarded[i] == 0);
  }
  CHECK(books.applied[2] != 0);
}

}  // namespace

TEST_CASE("a static press gives the force of the two springs in series") {
  for (const double e : {3e3, 8e3, 1e6}) {
    for (const double rate_hz : {10.0, 20.0, 60.0}) {
      for (const double latency : {0.0, 1.0, 2.0}) {
        CAPTURE(e, rate_hz, latency);
        const SoftPressed got =
            RunSoftPress({.youngs_modulus_pa = e,
                          .force_n = 4,
                          .loops = {.rate_hz = rate_hz, .latency_periods = latency}});
        // The plane of the mesh's unloaded surface and its compliance are exact; what is left is the
        // pad's place, which the nearest point of the dented surface shifts.
        CHECK(got.least_n == Approx(got.expected_n).epsilon(0.01));
        CHECK(got.most_n == Approx(got.expected_n).epsilon(0.01));
        CHECK(!got.flagged);
        CheckBooks(got.books);
      }
    }
  }
}

TEST_CASE("a hand presses, pokes and strokes it, and nothing buzzes") {
  const world::Scene scene = SoftBlock(8e3);
  const bool full = std::getenv("RIKISEKI_FULL") != nullptr;
  double first_most = 0;
  for (const auto coupling :
       {protocol::Coupling::kLocal, protocol::Coupling::kImpulse, protocol::Coupling::kPosition}) {
    for (const double rate_hz : {10.0, 20.0, 60.0}) {
      for (const double latency : {0.0, 1.0, 2.0}) {
        const bool hard = latency == 2.0 && rate_hz < 60;
        if (!full && !hard && (coupling != protocol::Coupling::kLocal || latency == 1)) continue;
        CAPTURE(static_cast<int>(coupling), rate_hz, latency);
        const SoftLoops loops{rate_hz, latency, coupling};
        const haptic::Settings settings = SoftSettings();
        // Three pokes of 60 ms, a press, strokes across the top, and rest.
        const auto program = [](double t_s) {
          const auto in = [&](double at_s, double in_s) {
            return haptic::MinimumJerk((t_s - at_s) / in_s);
          };
          double down = 0;
          for (const double at_s : {0.3, 0.5, 0.7}) down += in(at_s, 0.06) - in(at_s + 0.08, 0.06);
          down += in(1.0, 0.1);
          const double stroke = std::clamp(t_s - 1.3, 0.0, 1.0);
          return Vec3(0.015 * std::sin(4 * std::numbers::pi * stroke), 0.003,
                      kSoftTop + kSoftFinger + 0.005 - 0.025 * down);
        };
        IdealDevice hand(haptic::Hand(program, {0.58, 6.7, 135}), CoupledRun::StartNs(settings));
        const auto run = StartSoft(settings, loops, scene, hand);
        double most = 0, sum = 0, squares = 0;
        int resting = 0;
        for (int k = 0; k < 4500; ++k) {
          run->Tick();
          const double force = ForceOf(*run);
          REQUIRE(std::isfinite(force));
          most = std::max(most, force);
          if (k < 4000) continue;
          ++resting;
          sum += force;
          squares += force * force;
        }
        const double mean = sum / resting;
        // The hardest poke is the same at any rate and latency: nothing of it comes back late. What is
        // left is where the pad is, within the dent.
        if (first_most == 0) first_most = most;
        CHECK(most == Approx(first_most).epsilon(0.01));
        CHECK(mean > 1);
        // The hand's own oscillation, 3.5 Hz and damped by 5.8 /s and the surface, is gone by then.
        CHECK(std::sqrt(std::max(0.0, squares / resting - mean * mean)) < 0.01 * mean);
        CHECK(run->haptic_health().energy.flagged == 0);
        if (coupling != protocol::Coupling::kPosition) CheckBooks(run->haptic_health().books);
      }
    }
  }
}

TEST_CASE("a finger that slides over the top and off its edge feels no step") {
  const world::Scene scene = SoftBlock(8e3);
  for (const double rate_hz : {10.0, 20.0, 60.0}) {
    CAPTURE(rate_hz);
    const SoftLoops loops{.rate_hz = rate_hz, .latency_periods = 0.5};
    haptic::Settings settings = SoftSettings();
    settings.render.damping_ns_per_m = 0;  // it would show how planes turn, not whether they jump
    PrescribedDevice finger(
        [&](double t_s) {
          const double down = haptic::MinimumJerk((t_s - 0.3) / 0.2);
          return Vec3(-0.03 + 0.05 * std::max(0.0, t_s - 0.6), 0.004,
                      kSoftTop + kSoftFinger + 0.005 - 0.010 * down);
        },
        CoupledRun::StartNs(settings));
    const auto run = StartSoft(settings, loops, scene, finger);
    double last = 0, largest_step = 0, least = 1e9, most = 0;
    for (int k = 0; k < 2600; ++k) {
      run->Tick();
      const double force = ForceOf(*run);
      if (k > 600) largest_step = std::max(largest_step, std::abs(force - last));
      if (k > 1000 && k < 1400) {  // the middle, -10 to +10 mm
        least = std::min(least, force);
        most = std::max(most, force);
      }
      last = force;
    }
    // Nothing jumps: a tick changes the force by no more than what a plane that turns over an edge of
    // the block within a world period does to 2 N. (With stiffness in steps it would be 0.1 N.)
    CHECK(largest_step < 0.04);
    // In the middle the force is even, but for the edges, which give way more and are not far.
    CHECK(most < 2.2);
    CHECK(least > 1.6);
    CHECK(last == 0);
    CHECK(run->haptic_health().energy.flagged == 0);
  }
}

}  // namespace rikiseki::lab
