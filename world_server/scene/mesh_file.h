// SPDX-License-Identifier: MIT
// Triangles out of a mesh file (STL, OBJ, DAE), through assimp where the build has it.
#pragma once

#include <string>
#include <vector>

#include "common/geometry.h"
#include "world_server/geometry/triangle_mesh.h"

namespace rikiseki::world {

struct MeshTriangles {
  std::vector<Vec3> corners;
  std::vector<Triangle> triangles;
};

/// All the file's triangles, or those of the part called `submesh`, in metres where the file knows
/// its unit, along the axes as they stand in the file. Throws std::runtime_error with the reason.
MeshTriangles ReadMeshFile(const std::string& path, const std::string& submesh);

}  // namespace rikiseki::world
