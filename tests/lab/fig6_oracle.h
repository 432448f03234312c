// SPDX-License-Identifier: MIT
// The Fig. 6 experiment once more, as plain loops over doubles, from the written order of
// operations and sharing no code with the project: what the tests hold haptic_lab against.
#pragma once

namespace rikiseki::lab::oracle {

enum class Rule { kExact, kSemiImplicit };
enum class Method { kPosition, kImpulseInterpolate, kImpulseHold, kImpulseExtrapolate };

struct Push {
  bool poke = true;  // scenario P; false: scenario H
  Rule rule = Rule::kExact;
  Method method = Method::kPosition;
  double haptic_period = 1e-3;  // s
  int ticks_per_period = 50;    // n
  double stiffness = 2000;      // N/m
  double damping = 0;           // N s/m
  double mass = 1;              // kg
  double friction = 0.1;
  int phase = 0;           // haptic tick of the first world tick
  double face_offset = 0;  // m, added to the block's position at the start
};

struct Result {
  double position = 0;    // m, of the block after 3 s
  double impulse = 0;     // N s, displayed in all
  double peak_speed = 0;  // m/s, of the block after any world tick
};

Result Simulate(const Push& push);

}  // namespace rikiseki::lab::oracle
