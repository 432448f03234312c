// SPDX-License-Identifier: MIT
// What a rate, a coupling or a rule costs, and how wrong the result is. numerics section 7.
#pragma once

#include "tests/lab/study.h"

namespace rikiseki::lab {

/// The study `error-vs-runtime`.
Case ErrorVsRuntime();

}  // namespace rikiseki::lab
