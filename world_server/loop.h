// SPDX-License-Identifier: MIT
// The world loop around its step: wakes at the world rate, drains the haptic side's ledger, steps, and
// publishes the frame at once (holding a finished one costs a factor 3 in displacement error). An
// ordinary thread; everything it needs of the real world is here and nothing else.
#pragma once

#include <cstdint>

#include "protocol/owner.h"
#include "protocol/peer_link.h"
#include "protocol/stream.h"
#include "world_server/settings.h"
#include "world_server/step.h"

namespace rikiseki::world {

class WorldLoop {
 public:
  /// All outlive the loop.
  WorldLoop(const Settings& settings, WorldStep& step, protocol::SegmentOwner& owner,
            protocol::PeerLink& link);

  /// Another gap; nothing else is taken.
  void Tune(const Settings& settings);

  /// One world tick at `now_ns`, which was due at `deadline_ns`; `missed` deadlines were skipped since
  /// the tick before.
  void Tick(std::int64_t now_ns, std::int64_t deadline_ns, std::int64_t missed);

  protocol::PeerState peer_state() const { return peer_state_; }

 private:
  bool DrainLedger();
  double TimeToAdvance(std::int64_t now_ns, std::int64_t missed);
  void WatchPeer(std::int64_t now_ns, bool fresh);
  void Publish(std::int64_t now_ns, std::int64_t deadline_ns);
  void TakeNextPeer();

  const std::int64_t period_ns_;
  std::int64_t longest_advance_ns_;
  WorldStep& step_;
  protocol::SegmentOwner& owner_;
  protocol::PeerLink& link_;

  protocol::MessageWriter<protocol::WorldFrame> frames_;
  protocol::MessageWriter<protocol::WorldHealth> healths_;
  protocol::BodiesWriter bodies_;
  protocol::MessageReader<protocol::HapticTick> ticks_;

  protocol::HapticTick tick_;
  protocol::WorldFrame frame_;
  protocol::WorldHealth loop_health_;  // what the step does not know
  protocol::PeerState peer_state_ = protocol::PeerState::kAbsent;
  std::int64_t newest_tick_ns_ = 0;  // t_j + T: the impulse consumed runs to here
  std::int64_t world_clock_ns_ = 0;  // the world was advanced to here; 0 = not started
  std::uint64_t lapped_before_ = 0;  // by peers that are gone
};

}  // namespace rikiseki::world
