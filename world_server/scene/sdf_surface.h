// SPDX-License-Identifier: MIT
// The <surface> of a collision: friction, bounce, and how stiff it feels.
#pragma once

#include <sdf/Element.hh>
#include <string>
#include <vector>

#include "world_server/scene/scene.h"

namespace rikiseki::world {

/// Fills in all of a collider but its shape and place. Throws ConfigError with file and line; what is
/// not used is appended to `warnings`.
void ReadSurface(const sdf::ElementPtr& collision, Collider& collider,
                 std::vector<std::string>& warnings);

}  // namespace rikiseki::world
