// SPDX-License-Identifier: MIT
// A hand touches one body of a scene, strokes it and leaves again: the same touch for any scene, run
// with features in, left out or switched out, so that motion and cost can be compared.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "common/geometry.h"
#include "haptic_server/settings.h"
#include "protocol/messages.h"
#include "world_server/physics/engine_parts.h"
#include "world_server/scene/scene.h"
#include "world_server/settings.h"

namespace rikiseki::lab {

/// Everything that a touch depends on. What changes a feature changes this.
struct Touch {
  world::Scene scene;
  haptic::Settings haptic;
  world::Settings world;
  Vec3 place = Vec3::Zero();    // m, on the surface that is touched, in W
  Vec3 normal = Vec3::UnitX();  // unit, out of it
  std::function<void(protocol::WorldFrame&)> alter_frame = {};  // on its way to the haptic side
  std::optional<world::EngineParts> parts = {};  // of the engine; none = what the scene needs
  bool clutches_first = false;  // the operator pulls the clutch once, before the hand moves
};

/// The touch of a scene as the daemons' defaults run it: of its first body that moves, or of its
/// first one, from the side of -x, or from another if the hand cannot wait there. Throws
/// std::invalid_argument for a scene without shapes.
Touch TouchOf(const world::Scene& scene);

struct TouchResult {
  /// Every haptic tick as it would be published, from the moment the hand moves, without the
  /// settings that it repeats; and each body's motion, world tick by world tick.
  std::vector<std::uint64_t> ticks;
  std::vector<std::vector<std::uint64_t>> bodies;
  double largest_force_n = 0;
  std::vector<double> haptic_us;  // of the ticks in contact
  std::vector<double> world_us;   // of the world ticks since the hand moved
};

/// Whether both went alike to the bit; bodies that only one of them has are not compared.
bool SameMotion(const TouchResult& a, const TouchResult& b);

/// Deterministic, but for the times. Throws std::invalid_argument on what cannot be run.
TouchResult RunTouch(const Touch& touch);

}  // namespace rikiseki::lab
