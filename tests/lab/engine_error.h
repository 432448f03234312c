// SPDX-License-Identifier: MIT
// The engine's own error against its run time, without haptics: what no coupling can mend. numerics
// section 7.
#pragma once

#include "tests/lab/study.h"

namespace rikiseki::lab {

/// The study `engine-error`.
Case EngineError();

}  // namespace rikiseki::lab
