// SPDX-License-Identifier: MIT
#include <stdexcept>

#include "world_server/scene/mesh_file.h"

namespace rikiseki::world {

MeshTriangles ReadMeshFile(const std::string&, const std::string&) {
  throw std::runtime_error("this world_server was built without assimp and reads no meshes");
}

}  // namespace rikiseki::world
