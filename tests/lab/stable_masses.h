// SPDX-License-Identifier: MIT
// Which masses of the object a two-rate loop holds stable. numerics section 4.
#pragma once

#include <vector>

#include "tests/lab/multirate_loop.h"

namespace rikiseki::lab {

/// Masses [kg] between which the loop is stable.
struct StableInterval {
  double from = 0;
  double to = 0;
};
inline constexpr double kLeastMass = 1e-5;
inline constexpr double kGreatestMass = 1e4;

/// All stable intervals in kLeastMass .. kGreatestMass, to 1e-8 of their ends. Stability is not
/// monotone in the mass: masses are tried 1 % apart, and between them where the growth comes near 1.
/// A growth of 1e-8 per period counts as none.
std::vector<StableInterval> StableIntervals(const PeriodMap& map);

}  // namespace rikiseki::lab
