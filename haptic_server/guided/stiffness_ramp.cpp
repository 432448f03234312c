// SPDX-License-Identifier: MIT
#include "haptic_server/guided/stiffness_ramp.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <numbers>
#include <sstream>

#include "common/clock.h"
#include "haptic_server/safety/stability.h"

namespace rikiseki::haptic {
namespace {

constexpr double kSettleS = 3;  // until the weight is carried
constexpr double kFirst = 100;  // N/m
constexpr double kStep = 1.02;
constexpr double kMost = 1e5;      // N/m
constexpr double kTap = 1e-3;      // m
constexpr double kTapShare = 0.4;  // of the force cap, at most
// Rounding to counts keeps up swings of a few counts by itself, well below the limit of the theory.
constexpr double kLeastTapCounts = 10;
constexpr double kLeastSwingCounts = 12;
constexpr double kRunaway = 4;        // taps: no tap swings so far by itself
constexpr double kPeriods = 1.2;      // of the oscillation, in each part of a level
constexpr int kMostLimitedTicks = 5;  // of cap or slew limit, long after a tap that needs neither

}  // namespace

void StiffnessRamp::Swing::Add(double x) noexcept {
  low = std::min(low, x);
  high = std::max(high, x);
}

StiffnessRamp::StiffnessRamp(const Settings& settings, Device& device)
    : settings_(settings), device_(settings, device) {}

// RT:
void StiffnessRamp::BeginLevel(double stiffness) noexcept {
  stiffness_.store(stiffness, std::memory_order_relaxed);
  tap_m_ = std::min(kTap, kTapShare * settings_.safety.force_cap_n / stiffness);
  middle_m_ = middle_m_ > 0 ? -tap_m_ / 2 : tap_m_ / 2;
  const double period_s =
      2 * std::numbers::pi * std::sqrt(std::max(settings_.spidar.moving_mass_kg, 1e-3) / stiffness);
  part_s_ = std::max(kLevelS / 3, kPeriods * period_s);
  early_ = {};
  late_ = {};
  limited_ticks_ = 0;
  in_phase_s_ = 0;
}

// RT:
double StiffnessRamp::Wall(double x, double dt_s) const noexcept {
  const double speed = dt_s > 0 ? (x - last_x_) / dt_s : 0;
  return -stiffness() * (x - middle_m_) - settings_.render.damping_ns_per_m * speed;
}

// RT:
void StiffnessRamp::Judge(double x) noexcept {
  if (in_phase_s_ >= 2 * part_s_) {
    late_.Add(x);
  } else if (in_phase_s_ >= part_s_) {
    early_.Add(x);
  }
  const auto enter = [&](Phase phase) { phase_.store(phase, std::memory_order_relaxed); };
  const double count_m = settings_.spidar.count_length_m;
  const double least = std::max(tap_m_ / 2, kLeastSwingCounts * count_m);
  const double widest = std::max(early_.width(), late_.width());
  if (widest > kRunaway * tap_m_) {
    enter(Phase::kLimitCycle);
  } else if (limited_ticks_ > kMostLimitedTicks) {
    enter(widest > least ? Phase::kLimitCycle : Phase::kTooWeak);
  } else if (in_phase_s_ >= 3 * part_s_) {
    if (late_.width() > least && late_.width() >= early_.width()) {
      enter(Phase::kLimitCycle);
    } else if (stiffness() * kStep > kMost || tap_m_ < kLeastTapCounts * count_m) {
      enter(Phase::kTooWeak);
    } else {
      BeginLevel(kStep * stiffness());
    }
  }
}

bool StiffnessRamp::Tick(const TickTime& time, const OperatorInput& wish) noexcept {
  DeviceSample sample;
  const bool is_sound = device_.Read(time, wish, sample);
  const double dt_s = Seconds(time.previous_duration_ns);
  const double x = sample.position.x();
  if (!is_sound) {
    if (phase_.load(std::memory_order_relaxed) == Phase::kRamp) phase_.store(Phase::kInterrupted);
  } else if (phase_.load(std::memory_order_relaxed) == Phase::kRamp) {
    in_phase_s_ += dt_s;
    Judge(x);
  } else {
    in_phase_s_ += dt_s;
    if (in_phase_s_ >= kSettleS && device_.is_full()) {
      phase_.store(Phase::kRamp, std::memory_order_relaxed);
      BeginLevel(kFirst);
    }
  }
  const Phase phase = phase_.load(std::memory_order_relaxed);
  if (phase != Phase::kSettle && phase != Phase::kRamp) {
    Release();
    return false;
  }
  Vec3 wanted = Vec3::Zero();
  if (is_sound) {
    wanted = centring_.Force(sample.position, sample.velocity, dt_s);
    if (phase == Phase::kRamp) wanted.x() = Wall(x, dt_s);
    last_x_ = x;
  }
  device_.Display(wanted);
  const bool is_limited = device_.reason() == protocol::ForceReason::kCapped ||
                          device_.reason() == protocol::ForceReason::kSlewLimited ||
                          device_.reason() == protocol::ForceReason::kTensionLimited;
  if (phase == Phase::kRamp && in_phase_s_ >= part_s_ && is_limited) ++limited_ticks_;
  return true;
}

std::string StiffnessRamp::Prompt() const {
  if (phase_.load(std::memory_order_relaxed) == Phase::kSettle) {
    return "Let the grip hang in the middle, and let go of it.";
  }
  return "The grip is tapped at growing stiffness until it does not come to rest, for up to a "
         "minute. "
         "Do not touch it.";
}

Finding StiffnessRamp::Result() const {
  const Phase phase = phase_.load(std::memory_order_relaxed);
  std::ostringstream text;
  text << std::setprecision(3);
  const double damping = settings_.render.damping_ns_per_m;
  if (phase == Phase::kTooWeak) {
    text << "No limit cycle up to " << stiffness() << " N/m with a damping of " << damping
         << " N s/m; beyond, safety.force_cap_n and safety.slew_limit_n_per_s hide one.";
  } else if (phase == Phase::kLimitCycle) {
    text << "With a damping of " << damping << " N s/m, a limit cycle begins at " << stiffness()
         << " N/m.";
  } else {
    throw NothingFound("interrupted by a stop, a fault or a grip that was too fast");
  }
  const HeldMass device = DeviceAlone(settings_);
  if (!(device.mass_kg > 0)) return {text.str(), {}};
  text << " Theory, without dry friction: " << LargestStiffnessInWords(settings_) << ".";
  if (phase == Phase::kLimitCycle) {
    text << " Measured / theory: " << stiffness() / LargestStableStiffness(device, damping) << ".";
  }
  return {text.str(), {}};
}

}  // namespace rikiseki::haptic
