// SPDX-License-Identifier: MIT
// How wrong a run of both loops is, and what it costs: five pushes, each against the same push at a
// single rate (the error of the split alone) and against one that is all but continuous. numerics
// section 7.
#pragma once

#include <vector>

#include "common/rigid_body.h"
#include "tests/lab/cube_push.h"

namespace rikiseki::lab {

enum class ErrorSystem {
  kPoke,       // P: a light hand pokes a sliding block of 0.5 kg: block_push.h
  kPush,       // H: a firm hand pushes one of 2 kg
  kOffCentre,  // the cube of push_script.h, 0.5 kg, pushed 10 mm beside its middle
  kCorner,     // ... pushed while the finger is pressed to the floor
  kStack,      // ... with one of 0.25 kg on top
};

/// What is left of one run: enough to say how far two are apart.
struct RunRecord {
  std::vector<BodyState> bodies;   // those that move, when every impulse has arrived
  Vec3 impulse_ns = Vec3::Zero();  // displayed, over all
  std::vector<Vec3> force_n;       // every haptic tick of the script
  double largest_force_step_n = 0;
  double injected_j = 0;  // energy_meter.h
  double jump_m = 0;      // of a local copy at a frame, the largest
  double duration_s = 0;  // of the virtual time that all this took
  bool diverged = false;

  // Of this computer, and never twice alike:
  double cpu_s = 0;                   // of both loops and the simulated finger, one core
  std::vector<float> haptic_us = {};  // of each haptic tick, by the wall clock
  // Of both directions, as SPEC.md writes them; 0 unless they were counted.
  double bytes = 0;
};

enum class Measure { kCost, kBytes };

/// One run. `loops.latency_ticks` must be 0. Throws std::invalid_argument on what cannot be run.
RunRecord RunErrorSystem(ErrorSystem system, const PushLoops& loops, Measure measure);

/// The same push with everything at `period_s`. It is run once in a program and kept: any number of
/// threads may ask.
const RunRecord& SingleRateRecord(ErrorSystem system, double period_s);

inline constexpr double kContinuousPeriod = 2e-5;  // s: haptics, world and engine alike

/// Of the bodies' final places.
struct PlaceError {
  double rms_m = 0;     // over the phases; of several bodies, the root of the sum of squares
  double bias_m = 0;    // of the mean place
  double sd_m = 0;      // about it: rms^2 = bias^2 + sd^2
  double turn_rad = 0;  // RMS of the angle between the orientations
};
PlaceError CompareBodies(const std::vector<RunRecord>& runs, const RunRecord& truth);

/// RMS of the vector between two force traces of one haptic period, over the ticks in which either
/// is not zero [N]; the shorter one is 0 where it ends.
double ForceTraceError(const RunRecord& run, const RunRecord& truth);

}  // namespace rikiseki::lab
