// SPDX-License-Identifier: MIT
#include "haptic_server/device/velocity_estimate.h"

#include <cmath>
#include <numbers>

#include "common/clock.h"

namespace rikiseki::haptic {

const Vec3& VelocityEstimate::Update(std::int64_t now_ns, const Vec3& moved,
                                     double cutoff_hz) noexcept {
  const double dt = Seconds(now_ns - measured_ns_);
  if (!moving_) {
    velocity_.setZero();
  } else if (dt > 0) {
    const double weight = -std::expm1(-2 * std::numbers::pi * cutoff_hz * dt);
    velocity_ += weight * (moved / dt - velocity_);
  }
  moving_ = true;
  measured_ns_ = now_ns;
  return velocity_;
}

}  // namespace rikiseki::haptic
