// SPDX-License-Identifier: MIT
// The simulated hand: where it wants to be (a motor program over time) and how it yields to force
// (a mass-damper-spring about that target). numerics 5; reference scenarios P and H.
#pragma once

#include <cstdint>
#include <functional>
#include <random>
#include <vector>

#include "common/geometry.h"

namespace rikiseki::haptic {

/// The minimum-jerk profile s(q) = 10 q^3 - 15 q^4 + 6 q^5, with q clamped to 0..1.
double MinimumJerk(double q) noexcept;

/// One minimum-jerk move of a motor program; to where the hand already is: a pause.
struct Stroke {
  Vec3 to = Vec3::Zero();  // m
  double duration_s = 0;
};

/// `count` strokes to places drawn at random from the box between two of its corners [m], each
/// followed by a stay of `hold_s`; the same for the same seed, everywhere.
std::vector<Stroke> StirringStrokes(const Vec3& corner, const Vec3& opposite, double reach_s,
                                    double hold_s, std::uint64_t seed, int count);

/// C_d(t): strokes one after the other from `home`, then a rest of `rest_s` plus a random part
/// uniform in 0..`rest_jitter_s`; then from the start again if `repeats`, else it stays where the
/// strokes ended.
class MotorProgram {
 public:
  struct Script {
    Vec3 home = Vec3::Zero();
    std::vector<Stroke> strokes;
    bool repeats = false;
    double rest_s = 0;
    double rest_jitter_s = 0;
    std::uint64_t seed = 1;
  };

  /// Throws std::invalid_argument on a repeating script that takes no time.
  explicit MotorProgram(Script script);

  /// The target [m] at `t_s` since the start. Calls come in the order of time. // RT:
  Vec3 operator()(double t_s) noexcept;

 private:
  double RandomRest() noexcept;

  Script script_;
  double strokes_s_ = 0;      // duration of all strokes
  double cycle_start_s_ = 0;  // of the present repetition
  double cycle_s_ = 0;        // its duration with the rest
  std::mt19937_64 random_;
};

/// m y'' + b y' + k y = F on each axis, with a dry friction against the motion through the frame. The
/// device that the hand holds is part of m, b and the friction.
struct Impedance {
  double mass_kg = 1;
  double damping_ns_per_m = 0;
  double stiffness_n_per_m = 0;
  double friction_n = 0;
};

/// The exact step of an Impedance without its dry friction over `dt_s` under a held force:
/// y' = yy y + yv v + yf F, v' = vy y + vv v + vf F.
struct ImpedanceStep {
  double yy = 1, yv = 0, yf = 0;
  double vy = 0, vv = 1, vf = 0;
};
ImpedanceStep ExactStep(const Impedance& impedance, double dt_s) noexcept;

/// The hand: position = motor program + yielding.
class Hand {
 public:
  using Program = std::function<Vec3(double t_s)>;

  /// Starts at time 0 at rest on the program. Throws std::invalid_argument unless the mass is
  /// positive and the rest is not negative.
  Hand(Program program, const Impedance& impedance);

  /// Moves on by `dt_ns` under `force` [N, on the hand], held for that time. // RT:
  void Advance(std::int64_t dt_ns, const Vec3& force) noexcept;

  std::int64_t now_ns() const noexcept { return now_ns_; }
  const Vec3& target() const noexcept { return target_; }               // m, C_d
  Vec3 position() const noexcept { return target_ + yielding_; }        // m, C = C_d + y
  const Vec3& yielding_velocity() const noexcept { return velocity_; }  // m/s, y'

 private:
  Vec3 Friction(const Vec3& force, const Vec3& program_velocity) const noexcept;

  Program program_;
  Impedance impedance_;
  std::int64_t now_ns_ = 0;
  Vec3 target_;
  Vec3 yielding_ = Vec3::Zero();
  Vec3 velocity_ = Vec3::Zero();
  std::int64_t step_ns_ = 0;  // what step_ is for: most steps are alike
  ImpedanceStep step_;
};

}  // namespace rikiseki::haptic
