// SPDX-License-Identifier: MIT
// The tetrahedra of a soft body, and which of its nodes the fixed bodies of its scene hold.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "world_server/geometry/tetrahedra.h"
#include "world_server/scene/scene.h"

namespace rikiseki::world {

/// More make a step of the world too long.
inline constexpr double kMostSoftNodes = 1500;

struct SoftMesh {
  TetrahedralMesh mesh;            // in the body's frame
  std::vector<std::uint8_t> held;  // by node: in or on a fixed body of the scene at the start
};

/// Edge [m] of the elements of a shape for which nothing is said: about 200 nodes.
double UsualElement(const Shape& shape);

/// Nodes of the mesh with these elements; 0 for a shape that is not meshed: boxes, spheres and
/// ellipsoids are.
double SoftNodeCount(const Shape& shape, double element_m);

/// Of a body with a softness and one collider that can be meshed.
SoftMesh MeshSoftBody(const Scene& scene, const SceneBody& body);

/// In words what keeps this body from being simulated - nothing holds it, or it would collapse -
/// or nothing. `scene` has all bodies.
std::string WhyNotSoft(const Scene& scene, const SceneBody& body);

}  // namespace rikiseki::world
