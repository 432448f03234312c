// SPDX-License-Identifier: MIT
// A finger on a soft block that stands on a floor, in both step functions: the paper's section 5.5.
#pragma once

#include <memory>

#include "tests/lab/coupled_run.h"

namespace rikiseki::lab {

inline constexpr double kSoftTop = 0.06;     // m, of the block; its middle is above the origin
inline constexpr double kSoftFinger = 0.01;  // m, radius

struct SoftLoops {
  double rate_hz = 20;         // of the world
  double latency_periods = 0;  // of a frame
  protocol::Coupling coupling = protocol::Coupling::kLocal;
};

/// As shipped, but for a world as slow as these.
haptic::Settings SoftSettings();

/// A floor and a block of 80 x 80 x 60 mm, without weight: its surface is exactly where its box is.
world::Scene SoftBlock(double youngs_modulus_pa);

std::unique_ptr<CoupledRun> StartSoft(const haptic::Settings& settings, const SoftLoops& loops,
                                      const world::Scene& scene, haptic::Device& device);

/// What the finger feels now [N].
double ForceOf(const CoupledRun& run);

struct SoftPress {
  double youngs_modulus_pa = 8e3;
  double force_n = 2;  // that the finger goes down for; at most 8 mm
  SoftLoops loops;
};

struct SoftPressed {
  double expected_n = 0;  // of finger and block, two springs in series
  double least_n = 0;     // displayed, in the last of three halves of a second
  double most_n = 0;
  double dent_m = 0;  // of the block, by the springs
  bool flagged = false;
  protocol::Books books = {};  // at the end
};

/// A prescribed finger goes down within 0.2 s, near the middle of the top, and stays.
SoftPressed RunSoftPress(const SoftPress& press);

}  // namespace rikiseki::lab
