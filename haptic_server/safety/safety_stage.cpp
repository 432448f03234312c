// SPDX-License-Identifier: MIT
#include "haptic_server/safety/safety_stage.h"

#include <algorithm>
#include <cmath>

#include "common/clock.h"
#include "haptic_server/safety/peer_watch.h"

namespace rikiseki::haptic {
namespace {

using protocol::ForceReason;
using protocol::PeerState;

// Limits are kept a hair below, so that rounding cannot lift a result above them.
constexpr double kBelow = 1 - 1e-14;

// What a device may leave of a command before the tension limit is named as the reason.
constexpr double kMissedFraction = 0.01;
constexpr double kMissedForce = 0.05;  // N

bool Shorten(Vec3& v, double limit) {
  // Far below it, squares tell, whether or not they are denormal, and cost no division.
  if (v.squaredNorm() < 0.99 * limit * limit) return false;
  const double length = v.stableNorm();
  if (length <= limit) return false;
  v *= limit * kBelow / length;
  return true;
}

}  // namespace

SafetyStage::SafetyStage(const Settings& settings)
    : period_s_(Seconds(settings.period_ns())),
      fault_after_misses_(settings.loop.fault_after_misses) {
  Tune(settings.safety);
}

void SafetyStage::Tune(const SafetySettings& settings) noexcept {
  settings_ = settings;
  largest_step_n_ = settings.slew_limit_n_per_s * period_s_ * kBelow;
  ticks_to_zero_ = static_cast<std::int64_t>(std::ceil(settings.force_cap_n / largest_step_n_)) + 1;
}

ForceReason SafetyStage::Fault(const SafetyInput& input) noexcept {
  missed_in_a_row_ = input.missed > 0 ? missed_in_a_row_ + input.missed : 0;
  if (missed_in_a_row_ >= fault_after_misses_) return ForceReason::kLoopFault;
  if (!input.device_ok) return ForceReason::kDeviceFault;
  if (!input.sample_finite || !input.wanted.allFinite()) return ForceReason::kNotFinite;
  if (!(input.speed <= settings_.speed_limit_m_per_s)) return ForceReason::kOverSpeed;
  return ForceReason::kContact;
}

void SafetyStage::MoveGain(const SafetyInput& input, bool no_force) noexcept {
  const double elapsed_s = std::max(Seconds(input.previous_duration_ns), 0.0);
  const bool shows = input.peer == PeerState::kLive || input.peer == PeerState::kLate;
  const bool fades = input.peer == PeerState::kLost;
  const double faded = elapsed_s / (settings_.fade_ms * 1e-3);
  presence_ = shows ? 1 : fades ? std::max(0.0, presence_ - faded) : 0;
  if (no_force || (!shows && !fades)) {
    gain_ = 0;
  } else if (shows) {
    // A stall must not skip the soft start: it counts as one period.
    const double soft_start_s = settings_.soft_start_ms * 1e-3;
    gain_ =
        soft_start_s > 0 ? std::min(1.0, gain_ + std::min(elapsed_s, period_s_) / soft_start_s) : 1;
  } else {
    gain_ = std::max(0.0, gain_ - elapsed_s / (settings_.fade_ms * 1e-3));
  }
}

Vec3 SafetyStage::LightDamping(const SafetyInput& input, ForceReason fault) const noexcept {
  const bool too_fast = fault == ForceReason::kOverSpeed;
  const bool fades = fault == ForceReason::kContact && input.peer == PeerState::kLost;
  if (!(too_fast || fades) || input.stopped || !input.velocity.allFinite()) return Vec3::Zero();
  Vec3 velocity = input.velocity;  // a wild measurement must not become a blow
  Shorten(velocity, settings_.speed_limit_m_per_s);
  return -presence_ * settings_.light_damping_ns_per_m * velocity;
}

Vec3 SafetyStage::Limit(const SafetyInput& input) noexcept {
  const ForceReason fault = Fault(input);
  const bool faulted = fault != ForceReason::kContact;
  const bool no_force = input.stopped || faulted || input.clutched;
  MoveGain(input, no_force);

  const bool wants = !no_force && !input.wanted.isZero(0);
  Vec3 target = no_force || gain_ == 0 ? Vec3(Vec3::Zero()) : Vec3(gain_ * input.wanted);
  ground_ = LightDamping(input, fault);
  const bool brakes = !no_force && gain_ > 0 && input.brake.allFinite() && !input.brake.isZero(0);
  if (brakes) ground_ += gain_ * input.brake;
  if (!ground_.isZero(0)) target += ground_;
  const bool capped = Shorten(target, settings_.force_cap_n);
  Vec3 change = target - displayed_;
  const bool slewed = Shorten(change, largest_step_n_);
  command_ = slewed ? Vec3(displayed_ + change) : target;
  // Where a device does not follow, the cap and the way to zero go before the slew limit.
  Shorten(command_, settings_.force_cap_n);
  zero_ticks_ = target.isZero(0) ? zero_ticks_ + 1 : 0;
  if (zero_ticks_ > ticks_to_zero_) command_.setZero();
  if (!command_.allFinite() || input.stopped) command_.setZero();

  if (input.stopped) {
    reason_ = ForceReason::kEmergencyStop;
  } else if (faulted) {
    reason_ = fault;
  } else if (input.peer == PeerState::kLost) {
    reason_ = ForceReason::kWorldLost;
  } else if (input.peer != PeerState::kLive && input.peer != PeerState::kLate) {
    reason_ = ForceReason::kWorldAbsent;
  } else if (input.clutched) {
    reason_ = ForceReason::kClutched;
  } else if (brakes) {
    reason_ = ForceReason::kPassivity;
  } else if (slewed) {
    reason_ = ForceReason::kSlewLimited;
  } else if (capped) {
    reason_ = ForceReason::kCapped;
  } else if (wants && gain_ < 1) {
    reason_ = ForceReason::kSoftStart;
  } else if (input.no_channel) {
    reason_ = ForceReason::kNoChannel;
  } else if (input.peer == PeerState::kLate) {
    reason_ = ForceReason::kWorldLate;
  } else {
    reason_ = wants ? ForceReason::kContact : ForceReason::kNoContact;
  }
  return command_;
}

void SafetyStage::Displayed(const Vec3& force) noexcept {
  displayed_ = force.allFinite() ? force : Vec3(Vec3::Zero());
  const double missed = (displayed_ - command_).norm();
  const bool may_be_named =
      reason_ == ForceReason::kNoContact || reason_ == ForceReason::kContact ||
      reason_ == ForceReason::kCapped || reason_ == ForceReason::kSlewLimited ||
      reason_ == ForceReason::kSoftStart || reason_ == ForceReason::kWorldLate;
  if (may_be_named && missed > std::max(kMissedFraction * command_.norm(), kMissedForce)) {
    reason_ = ForceReason::kTensionLimited;
  }
}

std::int64_t ZeroForceAfter(const Settings& settings, std::int64_t world_period_ns) noexcept {
  const double slew_s = settings.safety.force_cap_n / settings.safety.slew_limit_n_per_s;
  const double fade_s = settings.safety.fade_ms * 1e-3;
  return LostAfter(settings, world_period_ns) +
         static_cast<std::int64_t>(std::ceil((fade_s + slew_s) * 1e9)) + 3 * settings.period_ns();
}

}  // namespace rikiseki::haptic
