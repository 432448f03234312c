// SPDX-License-Identifier: MIT
#include "world_server/physics/dynamics_world.h"

namespace rikiseki::world {

void DynamicsWorld::Play(std::span<const Stretch> stretches) {
  std::vector<Kick> kicks;
  for (const Stretch& stretch : stretches) {
    kicks.clear();
    for (const PlacedImpulse& push : stretch.pushes) {
      kicks.push_back(KickOf(push, State(push.body).pose.position));
    }
    ApplyAndStep(kicks, stretch.length_s);
  }
}

}  // namespace rikiseki::world
