// SPDX-License-Identifier: MIT
// One slide through both step functions and the engine that ship, beside the same slide with the
// world at the haptic rate: the force, its steps, and whether impulse and energy are all accounted
// for, whatever lies between device and world.
#pragma once

#include <vector>

#include "haptic_server/settings.h"
#include "protocol/messages.h"
#include "tests/lab/slide_script.h"

namespace rikiseki::lab {

/// How a slide is computed. Haptics at 1 kHz, limits so wide that they never act.
struct SlideLoops {
  protocol::Coupling coupling = protocol::Coupling::kImpulse;
  double world_period_s = 0.05;
  int latency_ticks = 0;  // of a frame, in haptic ticks
  int phase_ticks = 0;    // of the world's ticks against the script's start
  bool single = false;    // a single rate: the world ticks on every haptic tick, shown as it is
  double stiffness_n_per_m = 2000;
  double damping_ns_per_m = 2;
  double motion_scale = 1;  // of the mapping; the device is turned as well, where it is not 1
  double force_scale = 1;
};

struct SlideResult {
  std::vector<Vec3> force;  // N, at the device in device axes, every tick of the slide
  double step_ratio =
      0;  // largest step of that force in the script, over what the shipped slew limit
          // allows in a tick

  /// |Impulse in the books - sum of the displayed force times the tick, mapped into the world|, plus
  /// what the world did not account for, plus what the free block's momentum lacks; over the sum of
  /// the force's magnitude times the tick. The rounding of one unit is taken off.
  double books_error = 0;

  /// |Work of the device - s_f/s_x times work in the world|; for a free block pushed by `local`, also
  /// |work of the device - what the energy meter calls injected + s_f/s_x times what the block got|;
  /// over the sum of the magnitudes of the work tick by tick.
  double energy_error = 0;
  bool sound = true;  // finite
};

/// Throws std::invalid_argument on what cannot be run.
SlideResult SimulateSlide(const Slide& slide, const SlideLoops& loops);

/// The force of the slide against that of its own single-rate run, over `phases` sampling phases,
/// spread over the world period.
struct SlideComparison {
  double step_ratio = 0;         // the largest of any phase, and of the single rate
  double single_rms_n = 0;       // of the single rate's force
  double force_error_rms_n = 0;  // over all ticks of all phases
  double force_error_peak_n = 0;
  double books_error = 0;  // the largest of any phase, and of the single rate; energy likewise
  double energy_error = 0;
  bool sound = true;
};
SlideComparison CompareSlides(const Slide& slide, SlideLoops loops, int phases);

}  // namespace rikiseki::lab
