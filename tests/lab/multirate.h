// SPDX-License-Identifier: MIT
// Two loops of different rates on one object: how fast a deviation grows for a given mass, and which
// masses are stable. Paper 3; numerics sections 3 and 4.
#pragma once

#include "tests/lab/study.h"

namespace rikiseki::lab {

/// The study `multirate` on rows that ask for the stable masses of one method.
Case MultirateMasses();

/// The study `multirate` on rows that ask for the growth per world period of every method.
Case MultirateGrowth();

}  // namespace rikiseki::lab
