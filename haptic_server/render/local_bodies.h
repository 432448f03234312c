// SPDX-License-Identifier: MIT
// Copies of the bodies near the finger, moved by the finger's own force every tick, so that what is
// felt does not wait for the world. A frame brings the truth up to one of our ticks; from there the
// copies repeat the ticks since. The world repeats the same ticks by the same rules, so that both
// agree, whatever the world's period and latency. numerics.md section 4; SPEC.md 7.7.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "common/body_step.h"
#include "common/geometry.h"
#include "haptic_server/render/surface.h"
#include "protocol/messages.h"

namespace rikiseki::haptic {

/// What the ledger booked for one body in one tick, as it is published.
struct BodyImpulse {
  std::uint32_t body = 0;
  std::uint32_t generation = 0;
  Vec3 impulse = Vec3::Zero();          // N s, on the body, in W
  Vec3 angular_impulse = Vec3::Zero();  // N m s, about the world origin
};

inline constexpr std::size_t kMaxTickImpulses = 8;  // in one tick, by a few fingers

/// Ticks repeated beside the live one, at least: 4 us each in contact. Where a frame is so old that
/// this would not catch up before the next, 2 more than twice its age over the world's period: half
/// a period then does.
inline constexpr std::int64_t kReplayPerTick = 8;

class LocalBodies {
 public:
  /// Remembers the impulses of `history_ticks` ticks: frames that are older are not caught up with.
  /// `own_epoch`: frames that acknowledge another haptic epoch have seen none of our ticks; 0 = any
  /// counts.
  LocalBodies(std::int64_t period_ns, std::uint64_t history_ticks, std::uint64_t own_epoch,
              PositionRule rule);

  /// A frame arrived before tick `tick`. Bodies that it does not hold lose their copy when it is
  /// caught up with; new ones have one from now on. No copies at all after a frame that is of no
  /// tick we remember or that no step can be made of. A frame that comes while a nearer one is being
  /// caught up with is ignored. // RT:
  void Receive(const protocol::WorldFrame& frame, std::uint64_t tick) noexcept;

  /// The world is gone. // RT:
  void Clear() noexcept;

  /// Where a body's copy is now; null if it has none. // RT:
  const BodyState* Find(std::uint32_t body, std::uint32_t generation) const noexcept;

  /// Shares whose spring is too stiff for an explicit step of their copy, k T^2/M + 2 d T/M >= 1,
  /// are solved together with the copy and its contacts (backward Euler against the held finger);
  /// their force becomes the momentum that the copy gains / T. No mass is too light for that. // RT:
  void SolveStiff(std::span<BodyShare> shares) noexcept;

  /// Moves the copies through tick `tick`, which covers `length_s`, and repeats some of the ticks
  /// that the newest frame has not seen. `impulses` has at most kMaxTickImpulses. // RT:
  void Step(std::uint64_t tick, std::span<const BodyImpulse> impulses, double length_s) noexcept;

  /// How far the copies jump when a frame takes over.
  const protocol::Reconciliation& reconciliation() const noexcept { return reconciliation_; }

 private:
  struct Identity {
    std::uint32_t body = 0;
    std::uint32_t generation = 0;
  };
  struct Copies {
    std::size_t body_count = 0;
    std::size_t contact_count = 0;
    double longest_substep_s = 1;
    std::array<Identity, kMaxStepBodies> identities;
    std::array<bool, kMaxStepBodies> coasts;  // let in, but not caught up with yet
    std::array<StepBody, kMaxStepBodies> bodies;
    std::array<StepContact, kMaxStepContacts> contacts;

    std::size_t Place(std::uint32_t body, std::uint32_t generation) const noexcept;
    bool Sound() const noexcept;
    bool Usable() const noexcept;
  };
  struct TickRecord {
    double length_s = 0;
    std::size_t count = 0;
    std::array<BodyImpulse, kMaxTickImpulses> impulses;
  };

  void Load(const protocol::WorldFrame& frame, Copies& copies) const noexcept;
  void LetIn(const Copies& arriving, double age_s) noexcept;
  void Advance(Copies& copies, const TickRecord& record) noexcept;
  void CatchUp(std::uint64_t tick) noexcept;
  void TakeOver() noexcept;

  double period_s_;
  std::uint64_t own_epoch_;
  PositionRule rule_;
  std::vector<TickRecord> history_;  // of tick k at k modulo its size
  Copies live_;
  Copies arriving_;  // of the newest frame, still repeating ticks
  bool catching_up_ = false;
  std::uint64_t next_replay_ = 0;  // the tick that arriving_ repeats next
  std::int64_t replay_per_tick_ = kReplayPerTick;
  Copies scratch_;
  protocol::Reconciliation reconciliation_;
};

}  // namespace rikiseki::haptic
