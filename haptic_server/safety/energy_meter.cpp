// SPDX-License-Identifier: MIT
#include "haptic_server/safety/energy_meter.h"

#include <algorithm>
#include <cmath>

#include "common/clock.h"

namespace rikiseki::haptic {
namespace {

// What was absorbed is a credit, but not for ever: a long press must not pay for a later buzz.
constexpr double kLargestCredit = 1e-3;  // J

// Damping B on a mass m is stable up to B T/m = 2; filters and delays leave this much.
constexpr double kLargestBraking = 0.5;

// Smaller ups and downs of the penetration are no cycle: within one world period the hand's own
// oscillation rides on what the frames do.
constexpr double kCycleFraction = 0.5;  // of the last peak
constexpr double kCycleFloor = 1e-7;    // m
// Slower presses are a hand's; a slow world takes two to four of its periods for a cycle.
constexpr double kLongestCycleS = 2;
constexpr double kLongestCycleFrames = 6;
constexpr double kStaysFlaggedS = 1;  // s after the last sign

std::int64_t Ticks(double seconds, double period_s) {
  return static_cast<std::int64_t>(std::ceil(seconds / period_s));
}

}  // namespace

EnergyMeter::EnergyMeter(const Settings& settings)
    : damping_(settings.spidar.friction_damping_ns_per_m),
      largest_braking_(kLargestBraking * settings.spidar.moving_mass_kg /
                       Seconds(settings.period_ns())),
      period_s_(Seconds(settings.period_ns())),
      history_(static_cast<std::size_t>(std::max<std::int64_t>(Ticks(kEnergyWindow, period_s_), 1)),
               Excess{}) {
  Tune(settings.safety);
}

void EnergyMeter::Tune(const SafetySettings& settings) noexcept {
  largest_split_ = kHandsReach * settings.force_cap_n;
}

void EnergyMeter::Measure(const EnergySample& sample) noexcept {
  double leak = 0;
  double lost = 0;
  double injection = 0;
  if (known_) {
    const double given = force_.dot(sample.position - position_) - sample.surface_work;
    // The gain of the safety stage is no spring: what it changes is neither stored nor given back.
    leak = given + displayed_fraction_ * (sample.stored - stored_) + sample.split_work;
    lost = damping_ * sample.velocity.squaredNorm() * sample.duration_s;
    if (!std::isfinite(leak) || !std::isfinite(lost)) leak = lost = 0;
    if (std::isfinite(given)) {
      injection = given;
      injected_ += given;
      hand_work_ -= given + sample.surface_work;
      surface_work_ += sample.surface_work;
    }
    dissipated_ += lost;
  }
  known_ = true;
  position_ = sample.position;
  velocity_ = sample.velocity;
  stored_ = sample.stored;

  const bool begins = penetration_ == 0 && sample.penetration > 0;
  contact_leak_ = std::max(contact_leak_ + leak, begins ? 0.0 : -kLargestCredit);
  excess_.leak += leak - lost;
  excess_.injection += injection - lost;
  if (std::isfinite(sample.split_work)) excess_.split += sample.split_work;
  newest_ = (newest_ + 1) % history_.size();
  const Excess before = history_[newest_];
  history_[newest_] = excess_;

  WatchPeaks(sample);
  penetration_ = sample.penetration;
  const bool leaks = excess_.leak - before.leak > kUnstableEnergy && grown_ >= kGrowingPeaks;
  const bool is_driven =
      excess_.injection - before.injection > kUnstableEnergy && grown_by_surface_ >= kGrowingPeaks;
  const bool hurls = excess_.split - before.split > largest_split_;
  if (leaks || is_driven || hurls) {
    if (unstable_ticks_ == 0) ++flagged_;
    unstable_ticks_ = Ticks(kStaysFlaggedS, period_s_);
  } else if (unstable_ticks_ > 0) {
    --unstable_ticks_;
  }
}

void EnergyMeter::WatchPeaks(const EnergySample& sample) noexcept {
  const double penetration = sample.penetration;
  const double threshold = std::max(kCycleFraction * std::max(highest_, last_peak_), kCycleFloor);
  const double longest_cycle_s =
      std::max(kLongestCycleS, kLongestCycleFrames * sample.world_period_s);
  if (++ticks_since_peak_ > Ticks(longest_cycle_s, period_s_)) {
    grown_ = grown_by_surface_ = 0;
    last_peak_ = 0;
    was_cut_ = false;
    ticks_since_peak_ = 0;
  }
  if (rising_) {
    if (penetration > highest_) {
      highest_ = penetration;
      is_cut_ = displayed_fraction_ < 1;
    }
    if (penetration >= highest_ - threshold) return;
    NotePeak();
    lowest_ = penetration;
    rising_ = false;
  } else {
    lowest_ = std::min(lowest_, penetration);
    if (penetration <= lowest_ + threshold) return;
    highest_ = penetration;
    is_cut_ = displayed_fraction_ < 1;
    rising_ = true;
  }
}

// From peak to peak the springs have gained what hand and surfaces put in, less what they took back.
void EnergyMeter::NotePeak() noexcept {
  const bool grew = last_peak_ > 0 && (highest_ > last_peak_ || (is_cut_ && was_cut_));
  grown_ = grew ? grown_ + 1 : 0;
  grown_by_surface_ = grew && surface_work_ > hand_work_ ? grown_by_surface_ + 1 : 0;
  last_peak_ = highest_;
  was_cut_ = is_cut_;
  ticks_since_peak_ = 0;
  hand_work_ = surface_work_ = 0;
}

void EnergyMeter::Displayed(const Vec3& force, const Vec3& ground, const Vec3& rendered) noexcept {
  force_ = force;
  const double square = rendered.squaredNorm();
  if (square > 0 && std::isfinite(square)) {  // else the gain is as it was
    displayed_fraction_ = std::clamp((force - ground).dot(rendered) / square, 0.0, 1.0);
  }
}

Vec3 EnergyMeter::Brake() const noexcept {
  const double speed_square = velocity_.squaredNorm();
  if (!(contact_leak_ > 0) || penetration_ == 0 || !(speed_square > 1e-12)) return Vec3::Zero();
  const double damping = std::min(contact_leak_ / (speed_square * period_s_), largest_braking_);
  return -damping * velocity_;
}

}  // namespace rikiseki::haptic
