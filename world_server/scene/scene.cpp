// SPDX-License-Identifier: MIT
#include "world_server/scene/scene.h"

#include <algorithm>

namespace rikiseki::world {

bool Collide(const Scene& scene, std::size_t a, std::size_t b) {
  const SceneBody& first = scene.bodies[a];
  const SceneBody& second = scene.bodies[b];
  if (first.model != 0 && first.model == second.model && !first.self_collides &&
      !second.self_collides) {
    return false;
  }
  return std::none_of(scene.joints.begin(), scene.joints.end(), [=](const Joint& joint) {
    return (joint.parent == a && joint.child == b) || (joint.parent == b && joint.child == a);
  });
}

bool IsJointed(const Scene& scene, std::size_t body) {
  return std::any_of(scene.joints.begin(), scene.joints.end(), [=](const Joint& joint) {
    return joint.parent == body || joint.child == body;
  });
}

bool Deforms(const Scene& scene) {
  return std::any_of(scene.bodies.begin(), scene.bodies.end(),
                     [](const SceneBody& body) { return body.softness.has_value(); });
}

}  // namespace rikiseki::world
