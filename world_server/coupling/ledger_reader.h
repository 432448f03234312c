// SPDX-License-Identifier: MIT
// The world's end of the impulse ledger: turns the cumulative totals of haptic ticks into what each
// body is owed, and keeps the books of what was applied and what was declared not applied. SPEC.md
// section 7.
//
// Invariant, per axis and exactly (int64, modulo 2^64), whenever nothing is pending:
//   applied + discarded == sum over channels of the totals' growth since the baseline message.
// Hostile totals can do no more harm than the gap rule lets through.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "common/geometry.h"
#include "protocol/messages.h"
#include "world_server/physics/dynamics_world.h"

namespace rikiseki::world {

/// Who a channel may push: the body's present generation, whether it can move, and where it stands
/// in the scene.
struct BodyTag {
  std::uint32_t generation = 0;
  bool movable = false;
  std::size_t place = 0;
};

/// What one body got within a ReplayTick, about the world origin, in W.
struct ReplayImpulse {
  std::size_t body = 0;                 // its place in the scene
  Vec3 impulse = Vec3::Zero();          // N s
  Vec3 angular_impulse = Vec3::Zero();  // N m s
  // Only where messages were lost: the integral of what had arrived so far over the lost time, N s^2
  // and N m s^2, which says when within it the impulse came.
  Vec3 first_moment = Vec3::Zero();
  Vec3 angular_first_moment = Vec3::Zero();
  std::optional<Vec3> point = {};  // m, where it acted last
};

/// One consumed message, for `local`: the time it covers and what was displayed in it.
struct ReplayTick {
  double length_s = 0;
  std::uint64_t ticks = 1;  // more where messages were overwritten unread: this is their sum
  std::size_t end = 0;      // its impulses end here and begin where those of the tick before end
};

/// All messages since the world tick before, in order.
struct Replay {
  std::vector<ReplayTick> ticks;
  std::vector<ReplayImpulse> impulses;
};

/// What a body is owed in a world tick, and what it cost the fingers.
struct OwedPush {
  PlacedImpulse push;
  double work_j = 0;    // J, that the fingers did against it, up to the newest message
  double spring_j = 0;  // J, that their springs held before, when Take() was called last
};

/// Linear impulse since a baseline.
struct LedgerBooks {
  protocol::ImpulseUnits applied{};
  std::array<protocol::ImpulseUnits, protocol::kDiscardReasons> discarded{};

  protocol::ImpulseUnits TotalDiscarded() const;
};

class LedgerReader {
 public:
  /// `own_epoch` 0 accepts ticks whatever world they were displayed against. One world tick takes
  /// no more than `largest_impulse_ns` (force cap times gap): messages beyond it are discarded
  /// whole.
  LedgerReader(std::uint64_t own_epoch, protocol::Coupling coupling, double largest_impulse_ns);

  /// Another bound, from the next message on.
  void SetLargestImpulse(double largest_impulse_ns) { largest_impulse_ns_ = largest_impulse_ns; }

  /// Says which bodies there are, by their number on the wire. What is pending for one that is no
  /// longer what it was is discarded as kUnknownBody; for the others it stays.
  void SetBodies(std::vector<BodyTag> bodies);

  /// The next message is a baseline: nothing of it is owed. What is pending stays owed.
  void BeginEpoch(std::uint64_t epoch);

  /// One message; false, and nothing else, if it is not newer than the one before.
  bool Consume(const protocol::HapticTick& tick);

  /// Hands out what every body is owed, which counts as applied, and closes the world tick.
  std::span<const OwedPush> Take();

  /// Of what Take() handed out, this [N s] was not applied after all: it counts as discarded, as beyond
  /// what a world takes in a tick.
  void GiveBack(const Vec3& impulse);

  /// The same, message by message, of the last Take(); empty unless the coupling is `local`.
  const Replay& replay() const { return taken_replay_; }

  std::uint64_t acked_epoch() const { return has_baseline_ ? epoch_ : 0; }
  std::uint64_t acked_tick() const { return has_baseline_ ? last_tick_ : 0; }
  std::uint64_t baseline_tick() const { return has_baseline_ ? baseline_tick_ : 0; }

  /// Since the baseline of the present epoch; complete after Take().
  const LedgerBooks& epoch_books() const { return epoch_books_; }
  /// Since this reader was made.
  const LedgerBooks& life_books() const { return life_books_; }

 private:
  using Fingers = std::array<std::optional<Vec3>, protocol::kMaxPointers>;  // m, by pointer
  struct KnownChannel {
    std::uint32_t body = 0, generation = 0, pointer = 0;
    std::uint64_t opened_tick = 0;
    protocol::ImpulseUnits impulse{};
    protocol::ImpulseUnits angular_impulse{};
    Vec3 first_moment = Vec3::Zero();
    Vec3 angular_first_moment = Vec3::Zero();
    Vec3 force = Vec3::Zero();  // N, on the body, held since
    double spring_j = 0;        // J, of the finger

    bool Is(const protocol::Channel& channel) const;
  };
  struct Increment {
    std::uint32_t body = 0, generation = 0;
    protocol::ImpulseUnits impulse{};
    protocol::ImpulseUnits angular_impulse{};
    Vec3 first_moment = Vec3::Zero();  // of what came since the message before
    Vec3 angular_first_moment = Vec3::Zero();
    Vec3 point = Vec3::Zero();  // m, of the latest contact
    double work_j = 0;          // that the finger did since the message before
  };
  struct OwedUnits {
    protocol::ImpulseUnits impulse{};
    protocol::ImpulseUnits angular_impulse{};
    protocol::ImpulseUnits impulse_before{};  // of it, from epochs before this one
    double work_j = 0;
    double spring_j = 0;
  };

  /// Growth of every channel since the message before, `ticks` ago, which this one replaces.
  std::vector<Increment> IncrementsOf(const protocol::HapticTick& tick, std::uint64_t ticks,
                                      double length_s);
  /// A body of the scene, in this generation, that may be pushed.
  bool CanMove(std::uint32_t body, std::uint32_t generation) const;
  void Discard(const protocol::ImpulseUnits& impulse, protocol::DiscardReason reason);

  std::uint64_t own_epoch_;
  protocol::Coupling coupling_;
  double largest_impulse_ns_;

  std::uint64_t epoch_ = 0;
  bool has_baseline_ = false;
  std::uint64_t baseline_tick_ = 0;
  std::uint64_t last_tick_ = 0;
  std::uint64_t last_start_ns_ = 0;
  std::vector<KnownChannel> known_;  // of the last message, as are the fingers
  Fingers fingers_;

  std::vector<BodyTag> bodies_;  // by number, as are all below
  std::vector<OwedUnits> owed_;
  double consumed_ns_ = 0;   // sum of |q| over this world tick
  double consumed_nms_ = 0;  // of the angular ones
  std::vector<OwedPush> taken_;
  Replay replay_;        // by number
  Replay taken_replay_;  // by place

  LedgerBooks epoch_books_;
  LedgerBooks life_books_;
};

}  // namespace rikiseki::world
