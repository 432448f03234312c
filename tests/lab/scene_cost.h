// SPDX-License-Identifier: MIT
// What each feature costs in each scene: the time of a world tick and of a haptic tick in contact, with
// the feature in, left out because nothing needs it, and switched out; and whether the latter two
// move alike to the bit. Design decision 11.
#pragma once

#include "tests/lab/study.h"

namespace rikiseki::lab {

Case SceneCost();

}  // namespace rikiseki::lab
