#include "world_server/scene/needs.h"

#include <array>
#include <utility>

#include "protocol/messages.h"

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

SceneNeeds WorkOutNeeds(const Scene& scene) {
  std::size_t moving = 0;
  bool drag = false, deforms = false;
  for (const SceneBody& body : scene.bodies) {
    deforms = deforms || body.softness;
    if (body.fixed || body.softness) continue;
    ++moving;
    drag = drag || body.drag_ns_per_m > 0 || body.angular_drag_nms > 0;
  }
  SceneNeeds found;
  const auto sort = [&](bool needed, std::uint64_t bits) {
    (needed ? found.needs : found.left_out) |= bits;
  };
  sort(moving > 0, protocol::kNeedMovingBodies);
  sort(moving > 1, protocol::kNeedBodyContacts);
  sort(drag, protocol::kNeedDrag);
  sort(deforms, protocol::kNeedDeformation);
  // Without an engine there is none of this; with one, all of it.
  if (moving == 0) {
    sort(false, protocol::kNeedRotation | protocol::kNeedFastBodies | protocol::kNeedLocalBodies);
  }
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
