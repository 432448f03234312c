// SPDX-License-Identifier: MIT
// The tension allocation alone: a grip and a wanted force in, four tensions within bounds out.
// numerics section 6, "SPIDAR".
#pragma once

#include <array>

#include "haptic_server/device/tension.h"
#include "tests/lab/study.h"

namespace rikiseki::lab {

/// How far tensions are [N] from the conditions that single them out. Where the force is displayed:
/// what the balance lacks, or what the sum could still be lowered by along the one direction that
/// leaves the force alone. Where it is not: how far a step down the slope of the squared force
/// error, cut at the bounds, still moves a tension.
double TensionResidual(const std::array<Vec3, haptic::kTensionStrings>& directions,
                       const Vec3& force, const haptic::TensionBounds& bounds,
                       const haptic::TensionAllocation& allocation);

/// The study `tensions`.
Case Tensions();

}  // namespace rikiseki::lab
