// SPDX-License-Identifier: MIT
// What the stations that ship do while a contact lasts, along the contact's normal: every one of
// them is linear there, so a few differences about a pre-loaded contact tell all. The loops of
// numerics section 4 are put together from these numbers.
#pragma once

#include <vector>

#include "haptic_server/settings.h"

namespace rikiseki::lab {

/// The displayed surface j ticks after a frame: previous * x of the frame before + last * x of it.
struct DisplayWeights {
  double previous = 0;
  double last = 1;
};

/// The feature track over one world period of `ticks` haptic ticks: weights for j = 0 .. ticks - 1.
std::vector<DisplayWeights> ReadDisplay(haptic::DisplayRule rule, int ticks);

/// Contact solve and surface force: g = now * e + before * (e of the tick before), with e = C - s the
/// depth of the finger C behind the surface s and g [N] the force on the body.
struct ContactGains {
  double now = 0;     // N/m
  double before = 0;  // N/m
};
ContactGains ReadContact(double stiffness_n_per_m, double damping_ns_per_m, double period_s);

/// The world's penalty of coupling `position`: impulse on the body [N s] per depth [m].
double ReadPenalty(double stiffness_n_per_m, double world_period_s);

/// One step of a body without contacts: v' = v + speed_per_impulse q, and
/// x' = x + shift_per_speed v + shift_per_impulse q, with q [N s] the kick at its start.
struct BodyGains {
  double shift_per_speed = 0;
  double shift_per_impulse = 0;
  double speed_per_impulse = 0;
};

/// The body step that the local copies use.
BodyGains ReadBodyStep(double mass_kg, double step_s);

/// The slow world's step for the couplings without replay: one kick, one step.
BodyGains ReadWorldStep(double mass_kg, double world_period_s);

/// The implicit step of a local body (backward Euler of body, spring and damper against the held
/// finger): its impulse q = per_depth * (C - x) + per_speed * v.
struct ImplicitGains {
  double per_depth = 0;  // N s/m
  double per_speed = 0;  // kg
};
ImplicitGains ReadImplicitStep(double stiffness_n_per_m, double damping_ns_per_m, double mass_kg,
                               double period_s);

}  // namespace rikiseki::lab
