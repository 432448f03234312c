// SPDX-License-Identifier: MIT
#include "haptic_server/safety/peer_watch.h"

#include <algorithm>
#include <cmath>

namespace rikiseki::haptic {
namespace {

using protocol::PeerState;

std::int64_t Nanoseconds(double milliseconds) {
  return static_cast<std::int64_t>(std::llround(milliseconds * 1e6));
}

std::int64_t Periods(double periods, std::int64_t period_ns) {
  return static_cast<std::int64_t>(std::llround(periods * static_cast<double>(period_ns)));
}

std::int64_t LostAfter(const SafetySettings& safety, std::int64_t world_period_ns) {
  return std::max(Periods(safety.lost_periods, world_period_ns), Nanoseconds(safety.lost_floor_ms));
}

}  // namespace

std::int64_t LostAfter(const Settings& settings, std::int64_t world_period_ns) noexcept {
  const std::int64_t longest = Nanoseconds(settings.loop.longest_world_period_ms);
  return LostAfter(settings.safety, std::min(world_period_ns, longest));
}

PeerWatch::PeerWatch(const Settings& settings)
    : safety_(settings.safety),
      longest_period_ns_(Nanoseconds(settings.loop.longest_world_period_ms)) {
  SetPeriod(longest_period_ns_);
}

void PeerWatch::SetPeriod(std::int64_t world_period_ns) noexcept {
  world_period_ns_ = world_period_ns;
  late_after_ns_ = Periods(safety_.late_periods, world_period_ns);
  lost_after_ns_ = LostAfter(safety_, world_period_ns);
}

bool PeerWatch::Alive(std::int64_t now_ns, const PeerSign& sign) const noexcept {
  return sign.epoch == epoch_ && sign.ready && now_ns - sign.heartbeat_ns <= lost_after_ns_;
}

void PeerWatch::NoteFrame(std::int64_t now_ns, const PeerSign& sign) noexcept {
  frame_ns_ = now_ns;
  const std::int64_t period_ns = std::min(sign.frame_period_ns, longest_period_ns_);
  if (period_ns != world_period_ns_) SetPeriod(period_ns);
}

PeerState PeerWatch::Update(std::int64_t now_ns, const PeerSign& sign,
                            bool force_is_zero) noexcept {
  const std::int64_t age = frame_age_ns(now_ns);
  switch (state_) {
    case PeerState::kAbsent:
      epoch_ = sign.epoch;
      if (world_period_ns_ != longest_period_ns_) SetPeriod(longest_period_ns_);
      fresh_frames_ = 0;
      if (sign.epoch == 0 || !Alive(now_ns, sign)) {
        epoch_ = 0;
        break;
      }
      state_ = PeerState::kWaiting;
      [[fallthrough]];
    case PeerState::kWaiting:
      if (!Alive(now_ns, sign)) {
        state_ = PeerState::kAbsent;
        epoch_ = 0;
        break;
      }
      if (fresh_frames_ > 0 && age > lost_after_ns_) fresh_frames_ = 0;
      if (sign.fresh_frame) {
        NoteFrame(now_ns, sign);
        if (++fresh_frames_ >= kFreshFramesForLive) state_ = PeerState::kLive;
      }
      break;
    case PeerState::kLive:
    case PeerState::kLate:
      if (!Alive(now_ns, sign) || (!sign.fresh_frame && age > lost_after_ns_)) {
        state_ = PeerState::kLost;
      } else if (sign.fresh_frame) {
        NoteFrame(now_ns, sign);
        state_ = PeerState::kLive;
      } else if (age > late_after_ns_) {
        state_ = PeerState::kLate;
      }
      break;
    default:  // kLost
      if (force_is_zero) {
        state_ = PeerState::kAbsent;
        epoch_ = 0;
      }
      break;
  }
  return state_;
}

bool PeerWatch::Accepts(std::uint64_t epoch) const noexcept {
  return epoch == epoch_ && (state_ == PeerState::kWaiting || state_ == PeerState::kLive ||
                             state_ == PeerState::kLate);
}

}  // namespace rikiseki::haptic
