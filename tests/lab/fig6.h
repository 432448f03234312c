// SPDX-License-Identifier: MIT
// Fig. 6 of the paper: how far a block goes under one push should not depend on when the world happens
// to tick. Paper section 4; numerics sections 3 and 5.
#pragma once

#include "tests/lab/block_push.h"
#include "tests/lab/study.h"

namespace rikiseki::lab {

/// The study `fig6`.
Case Fig6();

}  // namespace rikiseki::lab
