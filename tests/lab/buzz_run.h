// SPDX-License-Identifier: MIT
// Does the force buzz? The simulated SPIDAR that ships - strings, encoder counts and the hand that holds
// the grip - against a light cube, with the world at its own rate or, to compare with, at the haptic
// rate; and what of the force lies above what a hand can do.
#pragma once

#include <optional>
#include <vector>

#include "haptic_server/settings.h"
#include "protocol/messages.h"
#include "tests/lab/pushed_shape.h"

namespace rikiseki::lab {

inline constexpr double kBuzzHz = 30;  // a hand does not move faster, a loop does

/// How the hand goes at the cube, in the terms of the [hand] section: there, stay, and back. The cube of
/// 6 cm lies about the origin, on a floor, and the finger has 1 cm.
struct Touch {
  const char* name;
  Vec3 home_mm;
  Vec3 stroke_mm;
  double reach_ms;
  double hold_ms;
  double finger_friction = 0;
};

/// The four touches of a 20 g cube that must not buzz. `press` holds on; `slide` presses the top and goes
/// along it with friction, not as far to its side as would tip a cube of 20 g.
inline const Touch kPushTouch = {"push", {-50, 0, 0}, {60, 0, 0}, 300, 100};
inline const Touch kPokeTouch = {"poke", {-45, 0, 0}, {20, 0, 0}, 120, 20};
inline const Touch kPressTouch = {"press", {0, 0, 55}, {0, 0, -20}, 300, 2500};
inline const Touch kSlideTouch = {"slide", {-20, 0, 46}, {25, 0, -9}, 500, 100, 0.3};

struct BuzzRun {
  Touch touch = kPushTouch;
  PushedShape shape = PushedShape::kCube;
  double mass_kg = 0.02;
  std::optional<protocol::Coupling> coupling = {};  // none: a single rate
  double world_period_s = 0.05;
  int latency_ticks = 0;
  int phase_ticks = 0;
};

/// The displayed force [N] of every tick of one cycle of the hand: rest, touch, and rest again. With the
/// settings that ship, soft start and limits included. Throws std::invalid_argument on what cannot be
/// run.
std::vector<double> SimulateBuzz(const BuzzRun& run);

/// The cycle of a hand that touches like this: [hand] with a rest of kHandRestMs before.
inline constexpr double kHandRestMs = 700;
haptic::HandSettings HandThat(const Touch& touch);

/// What to compare of a touch: of a trace at 1 kHz, from its first force above kTouched on: a second, padded with
/// zeros where it ends before, the touch and all that rings after it.
inline constexpr double kTouched = 0.2;  // N
std::vector<double> TouchOf(const std::vector<double>& force);

/// The energy [N^2 s] of a force sampled at 1 kHz in its Fourier components above kBuzzHz. Exact for a
/// trace that begins and ends without force.
double EnergyAbove(const std::vector<double>& force);

/// The last second of the press before the hand goes back, of a trace that SimulateBuzz gave.
std::vector<double> AtRest(const Touch& touch, const std::vector<double>& force);

/// The RMS [N] above kBuzzHz of a force sampled at 1 kHz that neither begins nor ends: under a Hann
/// window, less its mean.
double RmsAbove(const std::vector<double>& force);

/// What a pressed block may do at most [N, RMS above kBuzzHz]: 1.5 encoder counts times the stiffness.
double QuietRms(const haptic::Settings& settings);

/// A touch at `phases` sampling phases, spread over the world period, beside the same at a single rate,
/// with the same hand and the same encoder.
struct BuzzComparison {
  double single = 0;  // EnergyAbove [N^2 s] of the touch; of `press`, RmsAbove [N] at rest
  double mean = 0;    // likewise, of the phases
  double worst = 0;   // likewise
  double peak_n = 0;  // the largest force of any phase
  double quiet_rms_n = 0;
};
BuzzComparison CompareBuzz(BuzzRun run, int phases);

/// Whether a touch is judged by its rest, not by its energy.
bool IsPress(const Touch& touch);

}  // namespace rikiseki::lab
