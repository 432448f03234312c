// SPDX-License-Identifier: MIT
// What the stations of the renderer hand to each other: the surfaces that are displayed in a tick,
// and what each body does to the finger in it.
#pragma once

#include <cstdint>

#include "common/geometry.h"
#include "haptic_server/render/contact_solve.h"

namespace rikiseki::haptic {

/// A plane as it is displayed in one tick.
struct Surface {
  std::uint32_t pointer = 0;
  std::uint32_t body = 0;
  std::uint32_t generation = 0;
  std::uint32_t feature = 0;
  Vec3 velocity = Vec3::Zero();  // m/s, of the body's material at the contact; not of the plane
  double stiffness = 0;          // N/m; 0 = it brings none of its own
  double damping = 0;            // N s/m, used only where stiffness > 0
  double static_friction = 0;    // of the finger, Coulomb
  double dynamic_friction = 0;   // likewise
  double strength = 1;           // 0..1, of its stiffness and damping: a vanished one fades
  bool fixed = false;            // the world says that the body cannot move
  bool copied = false;           // it moves with a local copy of its body
  double radius = 0;             // m, of the ball that `plane` is tangent to; 0 = it is flat
  HalfSpace plane;               // unit normal
};

/// What one body does to the finger in this tick.
struct BodyShare {
  std::uint32_t body = 0;
  std::uint32_t generation = 0;
  Vec3 force = Vec3::Zero();         // N, on the user
  Vec3 point = Vec3::Zero();         // m, where the opposite impulse acts on the body: D - r n
  bool fixed = false;                // the body cannot move: its share belongs to the ground
  Vec3 displacement = Vec3::Zero();  // m, e_b
  double stiffness = 0;              // N/m, and damping, N s/m, that made the force
  double damping = 0;
};

}  // namespace rikiseki::haptic
