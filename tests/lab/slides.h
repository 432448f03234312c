// SPDX-License-Identifier: MIT
// The study of the slides: what a finger feels that slides over bodies which cannot move, at world
// rates from 60 down to 5 Hz, beside the same slide at a single rate; and whether impulse and energy
// are accounted for, with a mapping that scales motion and force too.
#pragma once

#include "tests/lab/study.h"

namespace rikiseki::lab {

/// The study `slides`.
Case Slides();

}  // namespace rikiseki::lab
