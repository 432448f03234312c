// SPDX-License-Identifier: MIT
#include "world_server/loop.h"

#include <algorithm>

#include "common/clock.h"
#include "common/histogram.h"
#include "common/realtime.h"

namespace rikiseki::world {
namespace {

// notes of SPEC.md 5.4: how long a haptic side may be silent before the world says so.
constexpr std::int64_t kLateFloorNs = 5'000'000;
constexpr std::int64_t kLostFloorNs = 20'000'000;
constexpr std::int64_t kLatePeriods = 5;
constexpr std::int64_t kLostPeriods = 20;

}  // namespace

WorldLoop::WorldLoop(const Settings& settings, WorldStep& step, protocol::SegmentOwner& owner,
                     protocol::PeerLink& link)
    : period_ns_(settings.period_ns()),
      longest_advance_ns_(static_cast<std::int64_t>(settings.gap_s() * 1e9)),
      step_(step),
      owner_(owner),
      link_(link),
      frames_(owner.Writer<protocol::WorldFrame>()),
      healths_(owner.Writer<protocol::WorldHealth>()),
      bodies_(owner.Stream(protocol::StreamType::kWorldBodies)) {
  loop_health_.period_ns = static_cast<std::uint64_t>(period_ns_);
  const RealtimeObtained scheduling = ReadScheduling();
  loop_health_.scheduling.policy = static_cast<std::uint32_t>(scheduling.policy);
  loop_health_.scheduling.priority = static_cast<std::uint32_t>(scheduling.priority);
}

void WorldLoop::Tune(const Settings& settings) {
  longest_advance_ns_ = static_cast<std::int64_t>(settings.gap_s() * 1e9);
}

void WorldLoop::Tick(std::int64_t now_ns, std::int64_t deadline_ns, std::int64_t missed) {
  loop_health_.missed += static_cast<std::uint64_t>(missed);
  // Asked before the ledger is drained: who is on offer then has a predecessor that publishes no more.
  // Asked after it, a stop in between could lose the predecessor's last ticks.
  const bool has_next = link_.HasNext();
  const bool fresh = DrainLedger();
  WatchPeer(now_ns, fresh);
  step_.Tick(TimeToAdvance(now_ns, missed), frame_);
  Publish(now_ns, deadline_ns);
  // Only after a frame has acknowledged the last tick of the old haptic epoch: it stays delivered.
  if (has_next) TakeNextPeer();
}

bool WorldLoop::DrainLedger() {
  bool fresh = false;
  while (true) {
    const protocol::ReadStatus status =
        ticks_.ReadNext(tick_, static_cast<std::uint64_t>(MonotonicNow()));
    if (status == protocol::ReadStatus::kFresh) {
      step_.Consume(tick_);
      newest_tick_ns_ = static_cast<std::int64_t>(tick_.start_ns + tick_.period_ns);
      fresh = true;
    } else if (status != protocol::ReadStatus::kRejected) {
      break;
    }
    if (ticks_.hopeless()) break;
  }
  if (ticks_.hopeless()) link_.Refuse();
  return fresh;
}

double WorldLoop::TimeToAdvance(std::int64_t now_ns, std::int64_t missed) {
  // The world follows the time of the impulses it consumed; alone, it follows its own.
  const std::int64_t nominal_ns = period_ns_ * (1 + missed);
  if (world_clock_ns_ == 0) world_clock_ns_ = now_ns - nominal_ns;
  const std::int64_t target_ns =
      peer_state_ == protocol::PeerState::kLive ? newest_tick_ns_ : world_clock_ns_ + nominal_ns;
  const std::int64_t advance_ns =
      std::clamp<std::int64_t>(target_ns - world_clock_ns_, 0, longest_advance_ns_);
  world_clock_ns_ = std::max(world_clock_ns_, target_ns);
  return Seconds(advance_ns);
}

void WorldLoop::WatchPeer(std::int64_t now_ns, bool fresh) {
  using protocol::PeerState;
  const protocol::PeerView* view = link_.current();
  if (view == nullptr || !view->Ready()) {
    peer_state_ = link_.incompatible() ? PeerState::kIncompatible : PeerState::kAbsent;
    return;
  }
  const auto tick_period_ns =
      static_cast<std::int64_t>(view->PeriodNs(protocol::StreamType::kHapticTick));
  const std::int64_t age_ns = now_ns - newest_tick_ns_;
  if (age_ns > std::max(kLostFloorNs, kLostPeriods * tick_period_ns)) {
    peer_state_ = PeerState::kLost;
  } else if (age_ns > std::max(kLateFloorNs, kLatePeriods * tick_period_ns)) {
    peer_state_ = PeerState::kLate;
  } else if (fresh) {
    peer_state_ = PeerState::kLive;
  }
}

void WorldLoop::Publish(std::int64_t now_ns, std::int64_t deadline_ns) {
  const auto stamp_ns = static_cast<std::uint64_t>(MonotonicNow());
  frames_.Publish(frame_, stamp_ns);
  owner_.Heartbeat(frame_.frame, stamp_ns);
  bodies_.Publish(step_.Bodies(), stamp_ns);

  ++loop_health_.lateness[HistogramBucket(now_ns - deadline_ns)];
  ++loop_health_.duration[HistogramBucket(static_cast<std::int64_t>(stamp_ns) - now_ns)];
  protocol::WorldHealth health = step_.health();
  health.frames = frame_.frame;
  health.period_ns = loop_health_.period_ns;
  health.missed = loop_health_.missed;
  health.lapped = lapped_before_ + ticks_.ring().lost();
  health.peer_state = peer_state_;
  health.peer_epoch = link_.current() == nullptr ? 0 : link_.current()->epoch();
  health.scheduling = loop_health_.scheduling;
  health.lateness = loop_health_.lateness;
  health.duration = loop_health_.duration;
  healths_.Publish(health, stamp_ns);
  owner_.SetCounters({.overruns = health.missed,
                      .lapped = health.lapped,
                      .read_retries = ticks_.ring().retries(),
                      .rejected = ticks_.rejected(),
                      .gaps = 0});
}

void WorldLoop::TakeNextPeer() {
  lapped_before_ += ticks_.ring().lost();
  const protocol::PeerView* view = link_.TakeNext();
  ticks_ = view->Reader<protocol::HapticTick>();
  step_.BeginHapticEpoch(view->epoch());
}

}  // namespace rikiseki::world
