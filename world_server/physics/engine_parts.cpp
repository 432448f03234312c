// SPDX-License-Identifier: MIT
#include "world_server/physics/engine_parts.h"

#include "world_server/scene/needs.h"

namespace rikiseki::world {

EngineParts EngineParts::Of(const Scene& scene) {
  const std::uint64_t needs = WorkOutNeeds(scene).needs;
  const auto needed = [needs](protocol::SceneNeed bit) { return (needs & bit) != 0; };
  EngineParts parts;
  parts.contacts = SomePairHas(scene, [](const Collider&) { return true; });
  parts.friction = needed(protocol::kNeedFriction);
  parts.rotation = needed(protocol::kNeedRotation);
  parts.drag = needed(protocol::kNeedDrag);
  parts.rebound = SomePairHas(scene, [](const Collider& c) { return c.restitution > 0; });
  parts.fast_bodies = needed(protocol::kNeedFastBodies);
  return parts;
}

}  // namespace rikiseki::world
