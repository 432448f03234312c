// SPDX-License-Identifier: MIT
// A soft spring that holds the grip in the middle of the frame, and carries its weight.
#pragma once

#include "common/geometry.h"

namespace rikiseki::haptic {

class Centring {
 public:
  /// N, on the grip at `position` [m] with `velocity` [m/s], after `dt_s`. // RT:
  Vec3 Force(const Vec3& position, const Vec3& velocity, double dt_s) noexcept {
    carried_ -= kCarry * dt_s * position;
    return carried_ - kStiffness * position - kDamping * velocity;
  }

 private:
  // Damped well for 0.01 to 0.2 kg; the weight is carried after a second or two:
  // kCarry < kStiffness kDamping / mass keeps it stable.
  static constexpr double kStiffness = 20;  // N/m
  static constexpr double kDamping = 1;     // N s/m
  static constexpr double kCarry = 20;      // N/(m s)

  Vec3 carried_ = Vec3::Zero();
};

}  // namespace rikiseki::haptic
