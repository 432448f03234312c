// SPDX-License-Identifier: MIT
// How fast something moves, from where it was measured: the backward difference through a first-order
// filter.
#pragma once

#include <cstdint>

#include "common/geometry.h"

namespace rikiseki::haptic {

class VelocityEstimate {
 public:
  /// Forgets what was measured: the next velocity is 0. // RT:
  void Restart() noexcept { moving_ = false; }

  /// The velocity [1/s of what `moved` is in] at `now_ns`, after having `moved` so much since the call
  /// before; filtered with a corner of `cutoff_hz`. // RT:
  const Vec3& Update(std::int64_t now_ns, const Vec3& moved, double cutoff_hz) noexcept;

 private:
  bool moving_ = false;  // there was a call before
  std::int64_t measured_ns_ = 0;
  Vec3 velocity_ = Vec3::Zero();
};

}  // namespace rikiseki::haptic
