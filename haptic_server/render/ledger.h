// SPDX-License-Identifier: MIT
// The books of the impulse: what was really displayed, to which body it belongs, and what the
// worlds have acknowledged of it. All sums are integers of 1e-12 N s, so they balance exactly.
// SPEC.md section 7; numerics 1.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "common/geometry.h"
#include "haptic_server/render/local_bodies.h"
#include "haptic_server/render/surface_force.h"
#include "protocol/impulse_units.h"
#include "protocol/messages.h"

namespace rikiseki::haptic {

/// Turns a stream of impulses into whole units and carries what is left over.
class ImpulseQuantizer {
 public:
  /// `impulse` in N s or N m s, saturated at +-4e6 per call. // RT:
  protocol::ImpulseUnits Add(const Vec3& impulse) noexcept;

 private:
  Vec3 remainder_ = Vec3::Zero();  // in units, |.| <= 0.5
};

/// Tick k books q_k = quantise(F_k T + F_(k-1) (dt_(k-1) - T)), F on the bodies: totals run to t_k
/// + T and telescope to the sum of F_i dt_i with the true dt.
class Ledger {
 public:
  /// Remembers the totals of `history_ticks` ticks, to look up what an ack covers. `own_epoch`:
  /// acks that name another haptic epoch cover nothing; 0 = all count.
  Ledger(std::int64_t period_ns, std::uint64_t history_ticks, std::uint64_t own_epoch);

  /// A frame of world `world_epoch`: books what its ack covers and frees the channels whose closing
  /// it has seen. The first ack of a new world sends all between the old world's last ack and the
  /// new one's baseline to `peer_lost`. Acks from the future, from the past, or of ticks that are
  /// forgotten are ignored. Before Book of the same tick. // RT:
  void Receive(std::uint64_t world_epoch, const protocol::WorldFrame& frame) noexcept;

  /// The surfaces of another world are displayed from now on: frees all channels, unless that world
  /// has acknowledged us already. Then it reads our totals, must see what closes them, and its acks
  /// free them. // RT:
  void BeginWorld(std::uint64_t world_epoch) noexcept;

  /// Makes sure that a body has an open channel. False if all are taken: its force must not be
  /// displayed. A body whose channel closed but was not freed gets the same one again. // RT:
  bool Open(std::uint32_t body, std::uint32_t generation, std::uint32_t pointer,
            std::uint64_t tick) noexcept;

  /// What the finger displayed in a tick.
  struct Entry {
    std::int64_t previous_duration_ns = 0;  // true t_k - t_(k-1)
    std::uint32_t pointer = 0;
    Vec3 displayed = Vec3::Zero();      // N, on the user
    Vec3 for_ground = Vec3::Zero();     // N, of it: what no body asked for
    std::span<const BodyShare> wanted;  // each with an open channel, unless its body is fixed
    Vec3 finger = Vec3::Zero();         // m, centre: where what belongs to nobody acts
    double largest_share = std::numeric_limits<double>::infinity();  // N, of one body
  };

  /// Books the next tick, from 0: body shares scaled by clip((displayed - for_ground) . wanted /
  /// |wanted|^2, 0, 1), those of fixed bodies and the rest to the ground. Every unit of the
  /// displayed force goes somewhere. Between two surfaces that meet at a sharp angle each share is larger
  /// than their sum by any factor: no body gets more than `largest_share`. // RT:
  void Book(const Entry& entry) noexcept;

  /// What that added to each open channel, as it is published; at most kMaxTickImpulses. // RT:
  std::span<const BodyImpulse> Booked() const noexcept {
    return std::span(booked_).first(booked_count_);
  }

  /// Closes channels of `pointer` that are idle and whose body `is_near` does not know. // RT:
  template <typename IsNear>
  void CloseIdle(std::uint32_t pointer, std::uint64_t tick, const IsNear& is_near) noexcept {
    for (Account& account : accounts_) {
      const protocol::Channel& channel = account.channel;
      if (account.used && channel.state == protocol::ChannelState::kOpen &&
          channel.pointer == pointer && account.force.isZero(0) &&
          !is_near(channel.body, channel.generation)) {
        Close(account, tick);
      }
    }
  }

  /// Writes channels and ground into the message. // RT:
  void Write(protocol::HapticTick& message) const noexcept;

  const protocol::Books& books() const noexcept { return books_; }

 private:
  struct Account {
    bool used = false;
    std::uint64_t closed_tick = 0;
    protocol::Channel channel;
    ImpulseQuantizer linear, angular;
    Vec3 force = Vec3::Zero();  // N, on the body, in the tick before
    Vec3 point = Vec3::Zero();  // m, where it acted
  };

  Account* Find(std::uint32_t body, std::uint32_t generation, std::uint32_t pointer) noexcept;
  void Close(Account& account, std::uint64_t tick) noexcept;
  void Pay(Account& account, const Vec3& force, const Vec3& point, double correction_s) noexcept;
  bool Lookup(std::uint64_t tick, protocol::ImpulseUnits& displayed) const noexcept;

  double period_s_;
  std::uint64_t own_epoch_;
  std::array<Account, protocol::kMaxChannels> accounts_;
  protocol::GroundChannel ground_;
  ImpulseQuantizer total_quantizer_;
  ImpulseQuantizer ground_angular_;
  Vec3 total_force_ = Vec3::Zero();    // N, minus the displayed force of the tick before
  Vec3 ground_moment_ = Vec3::Zero();  // N m, about the world origin, of the tick before
  std::array<BodyImpulse, kMaxTickImpulses> booked_;
  std::size_t booked_count_ = 0;

  protocol::Books books_;
  std::vector<protocol::ImpulseUnits>
      history_;              // books_.displayed after tick k, at k modulo its size
  std::uint64_t ticks_ = 0;  // booked so far

  std::uint64_t world_epoch_ = 0;  // who acknowledged last
  std::uint64_t world_baseline_ = 0;
  std::uint64_t acked_tick_ = 0;
  protocol::ImpulseUnits acked_{};                              // books_.displayed up to it
  protocol::ImpulseUnits world_applied_{}, world_discarded_{};  // as that world told them last
};

}  // namespace rikiseki::haptic
