// SPDX-License-Identifier: MIT
// Which bodies a finger could reach: the cheap question before the exact one. What can move is asked
// one by one (7 ns each, less than a tree of moving things costs to keep up), what cannot move is
// asked through a tree as soon as there is much of it.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "common/rigid_body.h"
#include "world_server/geometry/box_tree.h"
#include "world_server/scene/scene.h"

namespace rikiseki::world {

class NearBodies {
 public:
  explicit NearBodies(const Scene& scene);

  /// Fills `found` with every body of which some surface may be within `radius_m`, plus the way of
  /// its own surface in `time_s`, of `p`: none is missing, a few may be farther. In the scene's order.
  void Find(std::span<const BodyState> states, const Vec3& p, double radius_m, double time_s,
            std::vector<std::size_t>& found) const;

  /// No point of the body's surface moves farther in `time_s` [m]; infinite where a half-space turns.
  double WayOf(std::size_t body, const BodyState& state, double time_s) const;

 private:
  std::vector<double> radii_;  // m, of the ball about the centre of mass that holds the body
  std::vector<std::size_t> one_by_one_;
  std::vector<std::size_t> planted_;  // the items of the tree
  BoxTree tree_;
};

}  // namespace rikiseki::world
