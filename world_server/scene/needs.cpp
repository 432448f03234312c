// SPDX-License-Identifier: MIT
#include "world_server/scene/needs.h"

#include <algorithm>
#include <array>
#include <utility>

#include "world_server/physics/air.h"

namespace rikiseki::world {
namespace {

using protocol::SceneNeed;

constexpr std::array<std::pair<SceneNeed, const char*>, 8> kWords = {{
    {protocol::kNeedMovingBodies, "moving bodies"},
    {protocol::kNeedBodyContacts, "contacts among them"},
    {protocol::kNeedFriction, "friction"},
    {protocol::kNeedRotation, "rotation"},
    {protocol::kNeedDrag, "drag"},
    {protocol::kNeedFastBodies, "fast bodies"},
    {protocol::kNeedDeformation, "deformation"},
    {protocol::kNeedLocalBodies, "local bodies"},
}};

}  // namespace

bool SomePairHas(const Scene& scene, bool (*is)(const Collider&)) {
  std::size_t bodies = 0;
  bool one_moves = false;
  for (const SceneBody& body : scene.bodies) {
    if (body.softness) continue;  // touches nothing but what holds it
    if (std::none_of(body.colliders.begin(), body.colliders.end(), is)) continue;
    ++bodies;
    one_moves = one_moves || !body.fixed;
  }
  return one_moves && bodies > 1;
}

SceneNeeds WorkOutNeeds(const Scene& scene, const SceneUse& use) {
  std::size_t moving = 0;
  bool deforms = false;
  bool drag = false;
  bool precesses = false;
  bool rubs_finger = false;
  for (const SceneBody& body : scene.bodies) {
    for (const Collider& collider : body.colliders) {
      rubs_finger = rubs_finger || use.finger_friction * collider.friction > 0;
    }
    deforms = deforms || body.softness;
    if (body.fixed || body.softness) continue;
    ++moving;
    drag = drag || AirDrag::On(body).acts();
    precesses = precesses || !BodyInertia::Of(body.mass_kg, body.inertia).isotropic;
  }
  const bool meets = SomePairHas(scene, [](const Collider&) { return true; });
  const bool rubs = SomePairHas(scene, [](const Collider& c) { return c.friction > 0; });
  SceneNeeds found;
  const auto sort = [&](bool needed, protocol::SceneNeed bit) {
    (needed ? found.needs : found.left_out) |= bit;
  };
  sort(moving > 0, protocol::kNeedMovingBodies);
  sort(moving > 1, protocol::kNeedBodyContacts);
  sort(rubs || rubs_finger, protocol::kNeedFriction);
  sort(precesses, protocol::kNeedRotation);
  sort(drag, protocol::kNeedDrag);
  sort(meets, protocol::kNeedFastBodies);
  sort(deforms, protocol::kNeedDeformation);
  sort(moving > 0 && use.coupling == protocol::Coupling::kLocal, protocol::kNeedLocalBodies);
  return found;
}

std::string InWords(std::uint64_t needs) {
  std::string words;
  for (const auto& [bit, name] : kWords) {
    if ((needs & bit) == 0) continue;
    words += words.empty() ? "" : ", ";
    words += name;
  }
  return words.empty() ? "nothing" : words;
}

}  // namespace rikiseki::world
