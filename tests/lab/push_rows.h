// SPDX-License-Identifier: MIT
// The rows of the study `pushes`: which columns they have, what they mean, and how near `local` must
// come to its own single-rate run. numerics section 5.
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "tests/lab/cube_push.h"
#include "tests/lab/study.h"

namespace rikiseki::lab {

/// What makes a push, and how it is computed.
inline const std::vector<std::string> kPushColumns = {
    "script", "mass_kg", "mu", "kp", "kd", "offset_m", "gap_m", "neighbour_kg"};
inline const std::vector<std::string> kLoopColumns = {"coupling", "Tw_s", "latency_ticks",
                                                      "phases"};
inline constexpr const char* kSingleRate = "single";  // the coupling that is none
inline constexpr int kPushPhases = 20;                // where a row does not say

/// The results, by their place.
enum PushColumn : std::size_t {
  kDisplacementMean,
  kDisplacementSd,
  kDisplacementMin,
  kDisplacementMax,
  kForceMean,
  kForceSd,
  kForcePeak,
  kJumpMax,
  kYaw,
};
inline const std::array<const char*, kYaw + 1> kPushResults = {
    "displacement_mean_m", "displacement_sd_m", "displacement_min_m",
    "displacement_max_m",  "force_mean_n",      "force_sd_n",
    "force_peak_n",        "jump_max_m",        "yaw_rad"};

/// Throw ConfigError where a row makes no sense.
CubePush ParsePush(const Row& row);
PushLoops ParseLoops(const Row& row);

/// The fields of kPushColumns: rows with equal ones are about the same push.
std::vector<std::string> PushOf(const Row& row);

/// How far `local` may be from its own single-rate run; fractions are of that run's result.
struct PushBars {
  double displacement = 0.01;
  double displacement_floor_m = 1e-6;  // less is no displacement: so far may creep what sticks
  double sd = 0.003;                   // of the displacement, over the phases
  double jump_m = 2e-4;
  double force = 0.01;  // of the mean
  double peak = 0.02;   // of the largest force
  double yaw_rad = 0.5 * 3.14159265358979 / 180;
};
PushBars BarsOf(PushScript script, double world_period_s);

}  // namespace rikiseki::lab
