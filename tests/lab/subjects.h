// SPDX-License-Identifier: MIT
// Figs. 8 and 9 of the paper with simulated subjects: push a cube once so that it stops at the 30 cm
// mark, 30 times, and learn from each. Paper section 4; numerics section 5.
#pragma once

#include "tests/lab/study.h"

namespace rikiseki::lab {

/// The study `fig9`: one row is one subject with one coupling.
Case Subjects();

}  // namespace rikiseki::lab
