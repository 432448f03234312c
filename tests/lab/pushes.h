// SPDX-License-Identifier: MIT
// The study of the block pushes: what each coupling makes of a push over the sampling phases of the
// world, at several rates and frame latencies, beside the same push at a single rate. numerics
// section 5, "The block pushes, in three dimensions".
#pragma once

#include "tests/lab/study.h"

namespace rikiseki::lab {

/// The study `pushes`.
Case Pushes();

}  // namespace rikiseki::lab
