// The velocity of a measured position: its difference quotient behind a first-order low-pass.
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

#include "common/clock.h"
#include "common/geometry.h"

namespace rikiseki::haptic {

class VelocityFilter {
 public:
  /// Position [m] at `now_ns`; `cutoff_hz` is the corner. The velocity [m/s]: zero at the first position,
  /// the same as before at one of the same instant. // RT:
  Vec3 Update(std::int64_t now_ns, const Vec3& position, double cutoff_hz) noexcept {
    const double dt = Seconds(now_ns - before_ns_);
    if (!is_running_) {
      velocity_.setZero();
    } else if (dt > 0) {
      const double weight = -std::expm1(-2 * std::numbers::pi * cutoff_hz * dt);
      velocity_ += weight * ((position - before_) / dt - velocity_);
    }
    is_running_ = true;
    before_ns_ = now_ns;
    before_ = position;
    return velocity_;
  }

  /// What comes next has nothing to do with what came before. // RT:
  void Restart() noexcept { is_running_ = false; }

 private:
  bool is_running_ = false;
  std::int64_t before_ns_ = 0;
  Vec3 before_ = Vec3::Zero();
  Vec3 velocity_ = Vec3::Zero();
};

}  // namespace rikiseki::haptic
