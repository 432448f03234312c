// SPDX-License-Identifier: MIT
// How the displayed surfaces that press the finger move from tick to tick, and what work they do by
// it: the part of a body's motion that the energy meter must not blame. numerics 2.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "common/geometry.h"
#include "haptic_server/render/contact_solve.h"
#include "haptic_server/render/surface.h"

namespace rikiseki::haptic {

/// The displayed contact point of a tick, carried along by the planes that held it there: along a
/// plane's normal by what the plane moves at that point, along the surface by the body's material.
/// The sliding of the finger over its surfaces is no part of it.
class SurfaceMotion {
 public:
  /// What surfaces did on the hand [J].
  struct WorkDone {
    double all = 0;
    double split = 0;  // of it, by bodies that can move and have no local copy
  };

  /// The work [J] that the surfaces of the tick before did with the force that it displayed [N, on
  /// the user, W] by moving to where they are now. `elapsed_s` since then. // RT:
  WorkDone Work(std::span<const Surface> surfaces, const Vec3& force,
                double elapsed_s) const noexcept;

  /// The contact of this tick. // RT:
  void Remember(std::span<const Surface> surfaces, const ContactSolution& contact) noexcept;

  /// There is no contact. // RT:
  void Reset() noexcept { count_ = 0; }

 private:
  struct Pressing {
    std::uint32_t body = 0;
    std::uint32_t generation = 0;
    std::uint32_t feature = 0;
    double multiplier = 0;  // m
    double height = 0;      // m, of the proxy above the plane
  };

  std::size_t count_ = 0;
  std::array<Pressing, kMaxContactPlanes> pressing_;
  Vec3 proxy_ = Vec3::Zero();
  Vec3 displacement_ = Vec3::Zero();  // e
};

}  // namespace rikiseki::haptic
