// All that a body touches or may soon touch, from the scene's geometry: complete where an engine's
// manifold is not, gaps included and the support polygon whole. The haptic side's local copies live
// on these. numerics.md section 4.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "world_server/physics/dynamics_world.h"
#include "world_server/scene/scene.h"

namespace rikiseki::world {

/// Appends the contacts of `body` with those of `others` that have a gap of at most `reach_m`, deepest
/// first; `others` ascend. Boxes against boxes,
/// spheres and half-spaces, spheres against everything but meshes; false, and nothing appended, if
/// another pair, or one that bounces, is within reach. `states` go with `scene.bodies`; impulses are
/// left at zero.
bool FindContactSites(const Scene& scene, std::span<const BodyState> states, std::size_t body,
                      double reach_m, std::span<const std::size_t> others,
                      std::vector<ContactSite>& sites);
/// With all of the scene.
bool FindContactSites(const Scene& scene, std::span<const BodyState> states, std::size_t body,
                      double reach_m, std::vector<ContactSite>& sites);

}  // namespace rikiseki::world
