// SPDX-License-Identifier: MIT
// One push of a cube through both step functions and the engine that ship, with the world at its own
// rate or, to compare with, everything at the haptic rate; and the same over the sampling phases of
// the world.
#pragma once

#include <optional>

#include "haptic_server/settings.h"
#include "protocol/messages.h"
#include "tests/lab/prepared_run.h"
#include "tests/lab/push_script.h"

namespace rikiseki::lab {

/// How the push is computed.
struct PushLoops {
  /// Nothing: a single rate, the world ticks on every haptic tick and is shown as it is.
  std::optional<protocol::Coupling> coupling;
  double world_period_s = 0.05;
  int latency_ticks = 0;  // of a frame, in haptic ticks
  int phase_ticks = 0;    // of the world's ticks against the script's start
  double haptic_period_s = 1e-3;
  haptic::DisplayRule display = haptic::DisplayRule::kInterpolate;  // a single rate: kHold, always
  PositionRule position_rule = PositionRule::kSecondOrder;          // of the local copies
  double substep_s = 1e-3;                                          // of the engine
};

/// One push at one sampling phase.
struct PushResult {
  double displacement_m = 0;  // of the cube, along x, when all impulses have arrived
  double yaw_rad = 0;         // of the cube, about z
  double force_mean_n = 0;    // displayed, from 0.2 s on
  double force_sd_n = 0;      // over time, likewise
  double force_peak_n = 0;    // of the whole script
  double largest_jump_m = 0;  // of the local copy at a frame
  bool diverged = false;
};

/// Both loops up to the moment when the finger starts, everything at rest before it; bodies as of
/// PushScene. Throws std::invalid_argument on a push that cannot be run.
PreparedRun PrepareCubePush(const CubePush& push, const PushLoops& loops);

/// Throws as PrepareCubePush does.
PushResult SimulateCubePush(const CubePush& push, const PushLoops& loops);

/// The same over `phases` sampling phases, spread over the world period.
struct PushStatistics {
  double displacement_mean_m = 0, displacement_sd_m = 0;
  double displacement_min_m = 0, displacement_max_m = 0;
  double force_mean_n = 0;
  double force_sd_n = 0;  // the largest of any phase; so are peak and jump
  double force_peak_n = 0;
  double jump_max_m = 0;
  double yaw_rad = 0;  // mean
  bool diverged = false;
};
PushStatistics SimulateCubePushes(const CubePush& push, PushLoops loops, int phases);

}  // namespace rikiseki::lab
