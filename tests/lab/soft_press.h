// SPDX-License-Identifier: MIT
// What a finger feels of a soft block, by coupling, world rate and latency: the paper's section 5.5.
#pragma once

#include "tests/lab/study.h"

namespace rikiseki::lab {

/// The study `soft-press`.
Case SoftPresses();

}  // namespace rikiseki::lab
