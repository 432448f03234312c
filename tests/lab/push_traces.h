// SPDX-License-Identifier: MIT
// How a push of the paper's Fig. 6 goes over time. Paper section 4; fig6.h has its outcome.
#pragma once

#include "tests/lab/study.h"

namespace rikiseki::lab {

/// The study `fig6-traces`.
Case PushTraces();

}  // namespace rikiseki::lab
