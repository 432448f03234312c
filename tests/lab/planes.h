// SPDX-License-Identifier: MIT
// The contact solve alone: a finger and planes in, the nearest point outside all of them out.
// numerics section 6, "Planes".
#pragma once

#include <string>
#include <vector>

#include "common/geometry.h"
#include "haptic_server/render/contact_solve.h"
#include "tests/lab/study.h"

namespace rikiseki::lab {

/// Planes as tables write them: "px py pz nx ny nz;...", where nan and inf may stand. Throws
/// std::invalid_argument.
std::vector<haptic::HalfSpace> ParsePlanes(const std::string& text);

/// What makes a solution well or badly determined.
struct ContactCondition {
  double condition = 1;       // of the unit normals that touch (or, if infeasible, are violated)
  bool unique_count = false;  // the planes that push are determined, so they can be counted
};
ContactCondition ConditionOf(const Vec3& finger, std::span<const haptic::HalfSpace> planes,
                             const haptic::ContactSolution& solution);

/// How far a solution is [m] from the conditions that single it out: no plane violated (if
/// infeasible: no descent of the summed squares left), D - C made of normals that push where they
/// touch.
double ResidualOf(const Vec3& finger, std::span<const haptic::HalfSpace> planes,
                  const haptic::ContactSolution& solution);

/// The study `planes`.
Case Planes();

}  // namespace rikiseki::lab
