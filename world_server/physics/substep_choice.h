// SPDX-License-Identifier: MIT
// How long the substeps of a group may be: as long as its motion bears, which depends on what it is and
// does. Figures: the engine's measurements, scaled by size.
#pragma once

#include <span>

#include "world_server/physics/islands.h"

namespace rikiseki::world {

inline constexpr double kResting = 0.01;  // m/s: of what is slower in contact, any substep will do

/// What of a group bears on its substeps.
struct GroupMotion {
  std::size_t awake = 0;
  bool meets = false;         // something could be met
  bool meets_moving = false;  // ... that can move itself, or a joint holds two
  bool rebounds = false;      // restitution
  double smallest = 0;        // m, least inner diameter of those that could meet each other
  double mass_ratio = 1;      // heaviest / lightest of them, >= 1
  double turning = 0;         // rad/s, the fastest
  double crossing = 0;        // 1/s, the fastest speed / inner radius
  double speed = 0;           // m/s, of any point of any of them
  double drag = 0;            // 1/s, the fastest rate
  double gravity = 0;         // m/s^2
};

GroupMotion MotionOf(const Group& group, const BulletBodies& bodies, const Sleepers& sleepers);

/// How often the solver goes over the contacts: 50 times, more for ill-matched masses.
int Sweeps(const GroupMotion& motion);

/// Where a push enters [s], never longer than `substep_s`; shorter only where small or ill-matched
/// bodies meet each other.
double PushedSubstep(const GroupMotion& motion, double substep_s);

/// Where none does [s]: `window_s` in free flight and at rest, 5 ms of a lone body in contact; never shorter than
/// PushedSubstep.
double CoarseSubstep(const GroupMotion& motion, double substep_s, double window_s);

}  // namespace rikiseki::world
