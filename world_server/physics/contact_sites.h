// SPDX-License-Identifier: MIT
// All that a body touches or may soon touch, from the scene's geometry: complete where an engine's
// manifold is not, gaps included and the support polygon whole. The haptic side's local copies live
// on these. numerics.md section 4.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "world_server/physics/dynamics_world.h"
#include "world_server/physics/solid.h"
#include "world_server/scene/scene.h"

namespace rikiseki::world {

class SiteFinder {
 public:
  /// `scene` outlives this.
  explicit SiteFinder(const Scene& scene);

  /// Appends the contacts of `body` with those of `others`, which ascend, that have a gap of at most
  /// `reach_m`, deepest first; false, and nothing appended, if a pair that bounces is within reach.
  /// `states` go with the scene's bodies; impulses are left at zero.
  bool Find(std::span<const BodyState> states, std::size_t body, double reach_m,
            std::span<const std::size_t> others, std::vector<ContactSite>& sites) const;
  /// With all of the scene.
  bool Find(std::span<const BodyState> states, std::size_t body, double reach_m,
            std::vector<ContactSite>& sites) const;

 private:
  struct Placed {
    BodyInertia inertia;
    std::vector<Solid> solids;  // of its colliders
  };

  const Scene& scene_;
  std::vector<Placed> bodies_;
};

}  // namespace rikiseki::world
