// SPDX-License-Identifier: MIT
// The parts of the engine, one by one: what a scene does not need is not in its engine. A part that is
// left out gives the same bits as one that is in and has nothing to do.
#pragma once

#include "world_server/scene/scene.h"

namespace rikiseki::world {

struct EngineParts {
  bool contacts = true;     // broad phase, contact points, contact solver; without: integrator only
  bool friction = true;     // friction rows
  bool rotation = true;     // axes that precess; without, angular velocities are kept
  bool drag = true;         // of the air
  bool rebound = true;      // restitution
  bool fast_bodies = true;  // sweeping what moves farther than half its inner radius in a substep
  bool sleeping = true;     // what rests is not stepped
  bool long_substeps = true;  // Play: what no push reaches takes substeps as long as it bears

  /// What the scene needs; sleeping and long substeps always.
  static EngineParts Of(const Scene& scene);
};

}  // namespace rikiseki::world
