// SPDX-License-Identifier: MIT
// The gallery: a hand stirs in every scene of config/scenes, and what must hold of any scene holds.
#pragma once

#include "tests/lab/study.h"

namespace rikiseki::lab {

Case Gallery();

/// Every scene of config/scenes [path], sorted.
std::vector<std::string> GalleryScenes();

}  // namespace rikiseki::lab
