// SPDX-License-Identifier: MIT
// The study of the buzz: a hand on the simulated SPIDAR pushes, pokes, presses and slides over a cube of
// 20 g, and what of the force lies above 30 Hz is set beside the same touch at a single rate, with the
// same encoder.
#pragma once

#include "tests/lab/study.h"

namespace rikiseki::lab {

/// How much more than at a single rate may lie above 30 Hz, as a mean of the phases.
inline constexpr double kMostBuzz = 1.10;

/// The study `buzz`.
Case Buzz();

}  // namespace rikiseki::lab
