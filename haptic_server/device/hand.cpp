// SPDX-License-Identifier: MIT
#include "haptic_server/device/hand.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "common/clock.h"

namespace rikiseki::haptic {
namespace {

// The response y(t) to a unit force from rest, where both b t/m and k t^2/m are small: its power
// series, because the closed forms subtract nearly equal numbers there.
double ForceResponseSeries(const Impedance& impedance, double t) noexcept {
  const double damping = impedance.damping_ns_per_m * t / impedance.mass_kg;
  const double stiffness = impedance.stiffness_n_per_m * t * t / impedance.mass_kg;
  double before = 0;
  double term = t * t / (2 * impedance.mass_kg);  // of order 2 in t
  double sum = term;
  for (int order = 3; order < 18; ++order) {
    const double next = -(damping * term / order + stiffness * before / (order * (order - 1)));
    before = term;
    term = next;
    sum += term;
  }
  return sum;
}

// 0 to below 1, the same on every machine.
double Uniform(std::mt19937_64& random) noexcept {
  return static_cast<double>(random() >> 11) * 0x1p-53;
}

}  // namespace

double MinimumJerk(double q) noexcept {
  q = std::clamp(q, 0.0, 1.0);
  return q * q * q * (10 - 15 * q + 6 * q * q);
}

MotorProgram::MotorProgram(Script script) : script_(std::move(script)), random_(script_.seed) {
  for (const Stroke& stroke : script_.strokes) strokes_s_ += stroke.duration_s;
  if (script_.repeats && !(strokes_s_ + script_.rest_s > 0)) {
    throw std::invalid_argument("a repeating motor program must take time");
  }
  cycle_s_ = script_.repeats ? strokes_s_ + RandomRest() : std::numeric_limits<double>::infinity();
}

double MotorProgram::RandomRest() noexcept {
  return script_.rest_s + script_.rest_jitter_s * Uniform(random_);
}

std::vector<Stroke> StirringStrokes(const Vec3& corner, const Vec3& opposite, double reach_s,
                                    double hold_s, std::uint64_t seed, int count) {
  std::mt19937_64 random(seed);
  std::vector<Stroke> strokes;
  for (int i = 0; i < count; ++i) {
    Vec3 place = corner;
    for (int axis = 0; axis < 3; ++axis) {
      place[axis] += Uniform(random) * (opposite[axis] - corner[axis]);
    }
    strokes.push_back({place, reach_s});
    if (hold_s > 0) strokes.push_back({place, hold_s});
  }
  return strokes;
}

Vec3 MotorProgram::operator()(double t_s) noexcept {
  while (t_s - cycle_start_s_ >= cycle_s_) {
    cycle_start_s_ += cycle_s_;
    cycle_s_ = strokes_s_ + RandomRest();
  }
  double left = t_s - cycle_start_s_;
  Vec3 from = script_.home;
  for (const Stroke& stroke : script_.strokes) {
    if (left < stroke.duration_s) {
      return from + MinimumJerk(left / stroke.duration_s) * (stroke.to - from);
    }
    left -= stroke.duration_s;
    from = stroke.to;
  }
  return from;
}

ImpedanceStep ExactStep(const Impedance& impedance, double dt_s) noexcept {
  const double m = impedance.mass_kg;
  const double b = impedance.damping_ns_per_m;
  const double k = impedance.stiffness_n_per_m;
  const double decay = b / (2 * m);
  const double square = decay * decay - k / m;  // > 0: overdamped
  // exp(-decay t) times cos, cosh or 1, and sin/w, sinh/w or t.
  double c = 0;
  double s = 0;
  double slow = 0;  // the two real roots, if overdamped
  double fast = 0;
  const double split = std::sqrt(std::abs(square));
  if (square > 0) {
    fast = -(decay + split);
    slow = -(k / m) / (decay + split);
    const double e_fast = std::exp(fast * dt_s);
    const double e_slow = std::exp(slow * dt_s);
    c = (e_fast + e_slow) / 2;
    s = split * dt_s < 1 ? e_fast * std::expm1(2 * split * dt_s) / (2 * split)
                         : (e_slow - e_fast) / (2 * split);
  } else {
    const double envelope = std::exp(-decay * dt_s);
    c = envelope * std::cos(split * dt_s);
    s = split > 0 ? envelope * std::sin(split * dt_s) / split : envelope * dt_s;
  }
  ImpedanceStep step;
  step.yy = c + decay * s;
  step.yv = s;
  step.vy = -(k / m) * s;
  step.vv = c - decay * s;
  step.vf = s / m;
  if (b * dt_s / m < 0.1 && k * dt_s * dt_s / m < 0.1) {
    step.yf = ForceResponseSeries(impedance, dt_s);
  } else if (k == 0) {
    step.yf = (dt_s - s) / b;
  } else if (square > 0 && split * dt_s > 0.01) {
    step.yf = (fast * std::expm1(slow * dt_s) - slow * std::expm1(fast * dt_s)) / (slow - fast) / k;
  } else {
    step.yf = (1 - step.yy) / k;
  }
  return step;
}

Hand::Hand(Program program, const Impedance& impedance)
    : program_(std::move(program)), impedance_(impedance), target_(program_(0)) {
  if (!(impedance.mass_kg > 0) || !(impedance.damping_ns_per_m >= 0) ||
      !(impedance.stiffness_n_per_m >= 0) || !(impedance.friction_n >= 0)) {
    throw std::invalid_argument(
        "a hand needs a positive mass, no negative damping, stiffness or friction");
  }
}

// What stops the grip within the step, at most the friction that there is: N, on the hand.
Vec3 Hand::Friction(const Vec3& force, const Vec3& program_velocity) const noexcept {
  const Vec3 sliding =
      step_.vy * yielding_ + step_.vv * velocity_ + step_.vf * force + program_velocity;
  const double to_stop = sliding.norm() / step_.vf;
  if (to_stop <= impedance_.friction_n) return -sliding / step_.vf;
  return -sliding * (impedance_.friction_n / (to_stop * step_.vf));
}

void Hand::Advance(std::int64_t dt_ns, const Vec3& force) noexcept {
  if (dt_ns != step_ns_) {
    step_ns_ = dt_ns;
    step_ = ExactStep(impedance_, Seconds(dt_ns));
  }
  now_ns_ += dt_ns;
  const Vec3 target = program_(Seconds(now_ns_));
  Vec3 acting = force;
  if (impedance_.friction_n > 0 && dt_ns > 0) {
    acting += Friction(force, (target - target_) / Seconds(dt_ns));
  }
  const Vec3 yielding = step_.yy * yielding_ + step_.yv * velocity_ + step_.yf * acting;
  velocity_ = step_.vy * yielding_ + step_.vv * velocity_ + step_.vf * acting;
  yielding_ = yielding;
  target_ = target;
}

}  // namespace rikiseki::haptic
