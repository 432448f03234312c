// SPDX-License-Identifier: MIT
// Reads a scene from an SDFormat world file through libsdformat: what its elements mean in SDF,
// they mean here. What would change the motion and is not built is refused; what is left unused
// otherwise (plugins, sensors) is named.
#pragma once

#include <string>
#include <vector>

#include "world_server/scene/scene.h"

namespace rikiseki::world {

struct LoadedScene {
  Scene scene;
  std::vector<std::string> warnings;  // "file:line: what is not used", one line each
  std::vector<std::string> files;     // that it was read from: the scene's own first
};

/// Every link with collisions becomes a body, "model::link". Throws ConfigError with one line:
/// file, line, what is wrong, what would be right.
LoadedScene LoadSdf(const std::string& path);

}  // namespace rikiseki::world
