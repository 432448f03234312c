// SPDX-License-Identifier: MIT
// The features that a run can do without, and three ways to run it: with the feature in, left out
// because nothing needs it, and switched out. What is left out must cost what is switched out costs,
// and move everything alike, to the bit. numerics.md section 6; design decision 11.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "tests/lab/touch_run.h"

namespace rikiseki::lab {

/// Each of the three takes the touch of a scene and changes what the feature depends on.
struct FeatureSwitch {
  using Change = std::function<void(Touch&)>;
  std::string name;
  Change in;            // it acts
  Change left_out;      // it is on, but its values are zero, or nothing is there for it to act on
  Change switched_out;  // it is off; everything else is as in `left_out`
  bool
      changes_motion;  // whether `in` moves anything differently, in a scene with a block that moves
};

std::vector<FeatureSwitch> FeatureSwitches();

}  // namespace rikiseki::lab
