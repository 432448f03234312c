// SPDX-License-Identifier: MIT
// The last stage before the device. It trusts nobody: whatever the stages before computed, the
// command is finite, within the force cap, within the slew limit, and zero when there is no reason
// for a force. All forces are those at the device, on the user.
#pragma once

#include <cstdint>

#include "common/geometry.h"
#include "haptic_server/settings.h"
#include "protocol/messages.h"

namespace rikiseki::haptic {

/// What the safety stage must know of one tick.
struct SafetyInput {
  Vec3 wanted = Vec3::Zero();    // N, on the user, as rendered
  bool no_channel = false;       // a contact was left out of `wanted`
  bool device_ok = false;        // the device answered
  bool sample_finite = false;    // ... with finite numbers
  bool stopped = false;          // emergency stop
  bool clutched = false;         // the finger is disengaged from the world
  double speed = 0;              // m/s, of the finger
  Vec3 velocity = Vec3::Zero();  // m/s, likewise
  Vec3 brake = Vec3::Zero();     // N, on the user: of the passivity controller
  protocol::PeerState peer = protocol::PeerState::kAbsent;
  std::int64_t previous_duration_ns = 0;  // true t_k - t_(k-1)
  std::int64_t missed = 0;                // deadlines skipped in it
};

/// The force grows and fades by a gain in 0..1 on what was rendered: it rises over soft_start_ms
/// while a world is live or late, falls over fade_ms when it is lost, and is 0 at once on a fault
/// (device, finite check, over-speed, deadlines missed in a row) and while the clutch is engaged or
/// the emergency stop latched, from where it rises again by itself. The slew limit acts on every change, at the nominal period, against what was displayed
/// before: it is the last word, but for the emergency stop, which takes the force away within the
/// tick that it comes in. That is the one step in the force that is wanted.
///
/// A finger that is too fast, and any while a lost world fades out, is damped lightly; what no body
/// asked for - this and the passivity controller's brake - is told by ground(). It is capped, slewed
/// and faded like everything else, and over when the fade is.
class SafetyStage {
 public:
  explicit SafetyStage(const Settings& settings);

  /// Other caps, limits and times from the next Limit on. // RT:
  void Tune(const SafetySettings& settings) noexcept;

  /// The force to command [N]. // RT:
  Vec3 Limit(const SafetyInput& input) noexcept;

  /// What the device made of it. Call after each Limit. // RT:
  void Displayed(const Vec3& force) noexcept;

  /// Why the force is what it is, after Displayed. // RT:
  protocol::ForceReason reason() const noexcept { return reason_; }

  /// What of the last command no body asked for [N], before cap and slew. // RT:
  const Vec3& ground() const noexcept { return ground_; }

  /// Whether nothing is commanded: a lost world has faded out.
  bool is_zero() const noexcept { return command_.isZero(0); }

 private:
  protocol::ForceReason Fault(const SafetyInput& input) noexcept;
  void MoveGain(const SafetyInput& input, bool no_force) noexcept;
  Vec3 LightDamping(const SafetyInput& input, protocol::ForceReason fault) const noexcept;

  SafetySettings settings_;
  double period_s_;
  double largest_step_n_ = 0;       // slew limit times nominal period
  std::int64_t ticks_to_zero_ = 0;  // from the cap, at the slew limit
  std::int64_t fault_after_misses_;
  std::int64_t missed_in_a_row_ = 0;
  std::int64_t zero_ticks_ = 0;  // for so long nothing is wanted
  double gain_ = 0;
  double presence_ = 0;  // of a world: 1 while live or late, 0 when faded out
  Vec3 ground_ = Vec3::Zero();
  Vec3 command_ = Vec3::Zero();
  Vec3 displayed_ = Vec3::Zero();
  protocol::ForceReason reason_ = protocol::ForceReason::kWorldAbsent;
};

/// The stated bound [ns]: from the last sign of a world of this period to zero force, whatever
/// happens: lost + fade + cap/slew, and three ticks for noticing and for the last command to be
/// held.
std::int64_t ZeroForceAfter(const Settings& settings, std::int64_t world_period_ns) noexcept;

}  // namespace rikiseki::haptic
