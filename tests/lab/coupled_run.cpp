// SPDX-License-Identifier: MIT
#include "tests/lab/coupled_run.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "common/clock.h"

namespace rikiseki::lab {
namespace {

constexpr std::uint64_t kEpoch = 1;  // of either side: neither ever restarts

template <typename Work>
double Timed(Work&& work) {
  const std::int64_t start_ns = MonotonicNow();
  work();
  return Seconds(MonotonicNow() - start_ns);
}

}  // namespace

CoupledRun::CoupledRun(const haptic::Settings& haptic_settings, haptic::Device& device,
                       const world::Settings& world_settings, const world::Scene& scene,
                       std::unique_ptr<world::DynamicsWorld> dynamics, int phase_ticks,
                       int latency_ticks)
    : haptic_period_ns_(haptic_settings.period_ns()),
      world_period_ns_(world_settings.period_ns()),
      longest_advance_ns_(
          std::max(world_settings.period_ns(),
                   static_cast<std::int64_t>(std::llround(world_settings.gap_s() * 1e9)))),
      latency_ticks_(latency_ticks),
      world_due_ns_(phase_ticks * haptic_period_ns_),
      haptic_(haptic_settings, device, kEpoch),
      world_(world_settings, scene, std::move(dynamics), /*own_epoch=*/kEpoch) {
  if (latency_ticks < 0) throw std::invalid_argument("a frame cannot come before it was made");
  world_.BeginHapticEpoch(kEpoch);
  while (tick_ < 0) {
    TickHaptic({});
    if (tick_ < 0) TickWorld(0);
  }
  // The first world tick covers a whole period, whatever its phase.
  world_clock_ns_ = world_due_ns_ - world_period_ns_;
  if (haptic_.health().peer_state != protocol::PeerState::kLive) {
    throw std::invalid_argument("the haptic side does not take the world for live");
  }
}

bool CoupledRun::Tick(const haptic::OperatorInput& wish) {
  const std::int64_t now_ns = tick_ * haptic_period_ns_;
  const bool due = now_ns >= world_due_ns_;
  while (world_due_ns_ <= now_ns) world_due_ns_ += world_period_ns_;
  const bool ticks = due && !world_is_silent_;
  if (ticks) {
    TickWorld(std::min(now_ns - world_clock_ns_, longest_advance_ns_));
    world_clock_ns_ = now_ns;
  }
  TickHaptic(wish);
  return ticks;
}

void CoupledRun::TickWorld(std::int64_t advance_ns) {
  if (lapped_) Consume();
  effort_.world_s = consuming_s_ + Timed([&] { world_.Tick(Seconds(advance_ns), world_frame_); });
  consuming_s_ = 0;
  if (alter_) alter_(world_frame_);
  under_way_.push_back({tick_ + (tick_ < 0 ? 0 : latency_ticks_), world_frame_});
}

void CoupledRun::Consume() {
  consuming_s_ += Timed([&] { world_.Consume(haptic_tick_); });
}

void CoupledRun::TickHaptic(const haptic::OperatorInput& wish) {
  const bool first = tick_ == -kMeetingTicks;
  const haptic::TickTime time{.start_ns = (tick_ + kMeetingTicks) * haptic_period_ns_,
                              .previous_duration_ns = first ? 0 : haptic_period_ns_,
                              .missed = 0};
  if (!world_is_silent_) heartbeat_ns_ = time.start_ns;
  const bool arrives = !under_way_.empty() && under_way_.front().shown_in <= tick_;
  const haptic::WorldInput world{.epoch = kEpoch,
                                 .ready = true,
                                 .heartbeat_ns = heartbeat_ns_,
                                 .frame = arrives ? &under_way_.front().frame : nullptr};
  effort_.haptic_s = Timed([&] { haptic_.Tick(time, world, haptic_tick_, wish); });
  if (arrives) under_way_.pop_front();
  if (!lapped_) Consume();
  ++tick_;
}

}  // namespace rikiseki::lab
