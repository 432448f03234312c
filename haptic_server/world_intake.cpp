// SPDX-License-Identifier: MIT
#include "haptic_server/world_intake.h"

#include <span>

#include "common/clock.h"

namespace rikiseki::haptic {
namespace {

using protocol::PeerState;

constexpr std::int64_t kShortestFrameNs = 1'000;
constexpr std::uint64_t kLongestFrameNs = 10'000'000'000;

}  // namespace

WorldIntake::WorldIntake(const Settings& settings, std::uint64_t replay_ticks,
                         std::uint64_t own_epoch)
    : period_s_(Seconds(settings.period_ns())),
      track_(settings.render.display, settings.period_ns()),
      copies_(settings.period_ns(), replay_ticks, own_epoch, settings.render.position_rule),
      peer_(settings) {}

// Whether a new frame came that may be used, and books its ack if so. // RT:
bool WorldIntake::TakeFrame(const WorldInput& world, Ledger& ledger) noexcept {
  if (world.frame == nullptr || world.epoch == 0) return false;
  const protocol::WorldFrame& frame = *world.frame;
  const bool is_new = world.epoch != newest_epoch_ || frame.frame > newest_frame_;
  const bool is_sound = frame.plane_count <= protocol::kMaxPlanes &&
                        frame.period_ns >= kShortestFrameNs && frame.period_ns <= kLongestFrameNs;
  if (!is_new || !is_sound) return false;
  newest_epoch_ = world.epoch;
  newest_frame_ = frame.frame;
  ledger.Receive(world.epoch, frame);
  return true;
}

// RT:
bool WorldIntake::Update(const WorldInput& world, const Finger& finger, bool force_is_zero,
                         Ledger& ledger) noexcept {
  const bool fresh = TakeFrame(world, ledger);
  const PeerSign sign{
      .epoch = world.epoch,
      .ready = world.ready,
      .heartbeat_ns = world.heartbeat_ns,
      .fresh_frame = fresh,
      .frame_period_ns = fresh ? static_cast<std::int64_t>(world.frame->period_ns) : 0};
  const PeerState state = peer_.Update(finger.start_ns, sign, force_is_zero);

  if (finger.tick > 0) track_.Advance(finger.elapsed_ticks);
  if (state == PeerState::kAbsent && shown_epoch_ != 0) {
    track_.Clear();
    copies_.Clear();
    shown_epoch_ = shown_frame_ = 0;
  }
  if (!fresh || !peer_.Accepts(world.epoch)) return false;
  if (channel_epoch_ != world.epoch) {
    ledger.BeginWorld(world.epoch);
    channel_epoch_ = world.epoch;
  }
  // A surface as deep as the present contact, or as the finger gets in a tick or two, is no
  // surprise.
  const double approach =
      finger.velocity.stableNorm() * period_s_ * static_cast<double>(1 + finger.elapsed_ticks);
  const FingerState state_of_finger{finger.position, finger.radius,
                                    finger.penetration + approach + 1e-6};
  copies_.Receive(*world.frame, finger.tick);
  track_.Receive(*world.frame, std::span(&state_of_finger, 1), copies_);
  shown_epoch_ = world.epoch;
  shown_frame_ = world.frame->frame;
  return true;
}

}  // namespace rikiseki::haptic
