#include "tests/lab/coupled_run.h"

#include <stdexcept>
#include <utility>

#include "common/clock.h"

namespace rikiseki::lab {
namespace {

constexpr std::uint64_t kEpoch = 1;  // of either side: neither ever restarts

}  // namespace

CoupledRun::CoupledRun(const haptic::Settings& haptic_settings, haptic::Device& device,
                       const world::Settings& world_settings, const world::Scene& scene,
                       std::unique_ptr<world::DynamicsWorld> dynamics, int phase_ticks)
    : haptic_period_ns_(haptic_settings.period_ns()),
      ticks_per_period_(world_settings.period_ns() / haptic_period_ns_),
      world_period_s_(Seconds(world_settings.period_ns())),
      phase_ticks_(phase_ticks),
      haptic_(haptic_settings, device, kEpoch),
      world_(world_settings, scene, std::move(dynamics), /*own_epoch=*/kEpoch) {
  if (ticks_per_period_ < 1 ||
      ticks_per_period_ * haptic_period_ns_ != world_settings.period_ns()) {
    throw std::invalid_argument("the world period is not a whole number of haptic periods");
  }
  world_.BeginHapticEpoch(kEpoch);
  while (tick_ < 0) {
    TickHaptic();
    if (tick_ < 0) TickWorld(0);
  }
  if (haptic_.health().peer_state != protocol::PeerState::kLive) {
    throw std::invalid_argument("the haptic side does not take the world for live");
  }
}

bool CoupledRun::Tick() {
  const bool due = tick_ >= phase_ticks_ && (tick_ - phase_ticks_) % ticks_per_period_ == 0;
  if (due) TickWorld(world_period_s_);
  TickHaptic();
  return due;
}

void CoupledRun::TickWorld(double period_s) {
  if (lapped_) world_.Consume(haptic_tick_);
  world_.Tick(period_s, world_frame_);
  frame_is_new_ = true;
}

void CoupledRun::TickHaptic() {
  const bool first = tick_ == -kMeetingTicks;
  const haptic::TickTime time{.start_ns = (tick_ + kMeetingTicks) * haptic_period_ns_,
                              .previous_duration_ns = first ? 0 : haptic_period_ns_,
                              .missed = 0};
  const haptic::WorldInput world{.epoch = kEpoch,
                                 .ready = true,
                                 .heartbeat_ns = time.start_ns,
                                 .frame = frame_is_new_ ? &world_frame_ : nullptr};
  haptic_.Tick(time, world, haptic_tick_);
  frame_is_new_ = false;
  if (!lapped_) world_.Consume(haptic_tick_);
  ++tick_;
}

}  // namespace rikiseki::lab
