// SPDX-License-Identifier: MIT
// The study of extremes: whatever the settings and whatever comes, nothing unsound leaves either
// process, force and step stay within their limits, and a contact that is unstable is flagged at run
// time while a stable one is not. numerics section 6, "Extremes".
#pragma once

#include "tests/lab/study.h"

namespace rikiseki::lab {

/// The study `extremes`.
Case Extremes();

}  // namespace rikiseki::lab
