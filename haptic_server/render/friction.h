// SPDX-License-Identifier: MIT
// Friction of the finger on the bodies that it presses: a stick spring in the tangent plane with a
// static and a dynamic Coulomb limit. numerics 8.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "common/geometry.h"
#include "haptic_server/render/contact_solve.h"

namespace rikiseki::haptic {

/// What friction must know of one body in one tick.
struct FrictionContact {
  std::uint32_t body = 0;
  std::uint32_t generation = 0;
  Vec3 normal = Vec3::UnitX();  // unit, out of the body
  double normal_force = 0;      // N, how hard it presses
  double static_friction = 0;   // Coulomb
  double dynamic_friction = 0;
  double damping = 0;  // N s/m, of the stick spring
  Vec3 slip =
      Vec3::Zero();  // m, way of the finger over the body's *material* since the tick before
};

/// A finger that sticks is held by a spring from where it stuck; beyond the static limit it slides,
/// at the dynamic limit, against the relative motion, and sticks again when the spring would pull
/// less. The spring never pulls harder than the limit, so it gives back no more than it took.
/// A static coefficient below the dynamic one counts as equal to it.
class Friction {
 public:
  /// `stiffness` in N/m, positive.
  explicit Friction(double stiffness) : stiffness_(stiffness) {}

  /// Likewise. // RT:
  void SetStiffness(double stiffness) noexcept { stiffness_ = stiffness; }

  /// The tangential force [N, on the user]. Once per tick and body. // RT:
  Vec3 Force(const FrictionContact& contact, double elapsed_s) noexcept;

  /// The tick is over: bodies that Force was not asked for are let go. // RT:
  void EndTick() noexcept;

  void Reset() noexcept { count_ = 0; }

  /// Whether any body is held.
  bool holds() const noexcept { return count_ > 0; }

  /// What the stick springs hold [J]. // RT:
  double stored() const noexcept;

 private:
  struct Stuck {
    std::uint32_t body = 0;
    std::uint32_t generation = 0;
    Vec3 stretch = Vec3::Zero();  // m, of the stick spring
    bool slides = false;
    bool touched = false;  // in this tick
  };

  double stiffness_;
  std::size_t count_ = 0;
  std::array<Stuck, kMaxContactPlanes> stuck_;
};

}  // namespace rikiseki::haptic
