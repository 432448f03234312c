// SPDX-License-Identifier: MIT
#include "haptic_server/loop.h"

#include <sys/resource.h>

#include <algorithm>

#include "common/clock.h"
#include "common/histogram.h"

namespace rikiseki::haptic {
namespace {

constexpr std::int64_t kHealthPeriodNs = 10'000'000;
// CheckSettings keeps fade + cap/slew within 100 ms; a few ticks more to notice and to hold.
constexpr std::int64_t kLongestReleaseNs = 110'000'000;

}  // namespace

HapticLoop::HapticLoop(const Settings& settings, HapticStep& step, protocol::SegmentOwner& owner,
                       protocol::PeerLink& link, OperatorPanel& panel)
    : period_ns_(settings.period_ns()),
      health_every_(
          std::max<std::uint64_t>(1, static_cast<std::uint64_t>(kHealthPeriodNs / period_ns_))),
      step_(step),
      owner_(owner),
      link_(link),
      panel_(panel),
      ticks_(owner.Writer<protocol::HapticTick>()),
      healths_(owner.Writer<protocol::HapticHealth>()) {}

void HapticLoop::Run(const std::atomic<bool>& stop) noexcept {
  PeriodicSchedule schedule(MonotonicNow(), period_ns_);
  std::int64_t missed = 0;
  while (!(stop.load(std::memory_order_relaxed) && IsReleased())) {
    const std::int64_t deadline_ns = schedule.deadline_ns();
    SleepUntil(deadline_ns);
    const std::int64_t now_ns = MonotonicNow();
    // A stop while asleep must be known to this tick already, not to the next.
    missed += schedule.WakeUp(now_ns);
    Tick(now_ns, deadline_ns, missed);
    missed = schedule.Advance(MonotonicNow());
  }
  Stop();
}

// A stop is no step in the force: the world is taken for lost first, so that the force fades.
bool HapticLoop::IsReleased() noexcept {
  if (!releasing_) {
    releasing_ = true;
    release_ticks_left_ = kLongestReleaseNs / period_ns_ + 1;
    return false;
  }
  const protocol::ForceReason reason = step_.health().reason;
  return reason == protocol::ForceReason::kWorldAbsent ||
         reason == protocol::ForceReason::kEmergencyStop || --release_ticks_left_ <= 0;
}

void HapticLoop::Tick(std::int64_t now_ns, std::int64_t deadline_ns, std::int64_t missed) noexcept {
  const std::uint64_t performed = progress();
  const TickTime time{.start_ns = now_ns,
                      .previous_duration_ns = performed == 0 ? 0 : now_ns - previous_start_ns_,
                      .missed = missed};
  WorldInput world = ReadWorld();
  if (releasing_) world.ready = false;
  if (Tuning tuning; tuning_.Take(tuning)) step_.Tune(tuning);
  step_.Tick(time, world, tick_, panel_.Take());
  previous_start_ns_ = now_ns;
  PublishTick();

  ++lateness_[HistogramBucket(now_ns - deadline_ns)];
  ++duration_[HistogramBucket(MonotonicNow() - now_ns)];
  if (performed % health_every_ == 0) PublishHealth();
  performed_.store(performed + 1, std::memory_order_relaxed);
}

void HapticLoop::Stop() noexcept {
  step_.Stop(MonotonicNow(), tick_);
  PublishTick();
  PublishHealth();
}

// A world that was replaced is read once more before it is let go: its last frame may cover impulses that
// would be declared lost otherwise.
WorldInput HapticLoop::ReadWorld() noexcept {
  const auto read_latest = [this] {
    return frames_.ReadLatest(frame_, static_cast<std::uint64_t>(MonotonicNow()));
  };
  // Asked before the last look: what the dead one published is then all there.
  const bool has_next = link_.HasNext();
  protocol::ReadStatus read = read_latest();
  if (read != protocol::ReadStatus::kFresh && has_next) {
    frames_ = link_.TakeNext()->Reader<protocol::WorldFrame>();
    read = read_latest();
  }
  if (read == protocol::ReadStatus::kFresh) {
    coupling_.store(frame_.coupling, std::memory_order_relaxed);
    world_period_ns_.store(frame_.period_ns, std::memory_order_relaxed);
  }
  if (frames_.hopeless()) link_.Refuse();
  const protocol::PeerView* view = link_.current();
  if (view == nullptr) return {};
  return {.epoch = view->epoch(),
          .ready = view->Ready(),
          .heartbeat_ns = static_cast<std::int64_t>(view->HeartbeatNs()),
          .frame = read == protocol::ReadStatus::kFresh ? &frame_ : nullptr};
}

void HapticLoop::PublishTick() noexcept {
  const auto now_ns = static_cast<std::uint64_t>(MonotonicNow());
  ticks_.Publish(tick_, now_ns);
  owner_.Heartbeat(tick_.tick, now_ns);
  reason_.store(step_.health().reason, std::memory_order_relaxed);
  unstable_.store(step_.health().energy.unstable != 0, std::memory_order_relaxed);
}

void HapticLoop::PublishHealth() noexcept {
  health_ = step_.health();
  if (link_.incompatible()) health_.peer_state = protocol::PeerState::kIncompatible;
  health_.lateness = lateness_;
  health_.duration = duration_;
  health_.scheduling = scheduling_;
  rusage usage{};
  getrusage(RUSAGE_THREAD, &usage);
  health_.minor_faults = static_cast<std::uint64_t>(usage.ru_minflt);
  health_.major_faults = static_cast<std::uint64_t>(usage.ru_majflt);
  healths_.Publish(health_, static_cast<std::uint64_t>(MonotonicNow()));
  owner_.SetCounters({.overruns = health_.missed,
                      .lapped = 0,  // only the newest frame is of interest
                      .read_retries = frames_.ring().retries(),
                      .rejected = frames_.rejected(),
                      .gaps = 0});
}

}  // namespace rikiseki::haptic
