// SPDX-License-Identifier: MIT
#include "world_server/viewer/pair_watch.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "common/clock.h"

namespace rikiseki::viewer {
namespace {

using protocol::AttachResult;
using protocol::AttachStatus;
using protocol::PeerView;
using protocol::ReadStatus;
using protocol::StreamType;

constexpr std::int64_t kPollNs = 5'000'000;
constexpr std::int64_t kLookNs = 100'000'000;  // between two looks at the owners
constexpr std::size_t kTicksKept = 4096;
constexpr std::uint64_t kSameMomentNs = 1'000'000;  // a frame and its bodies are published together
constexpr std::uint64_t kBodiesAwaitedNs = 20'000'000;  // by other worlds, perhaps, or not at all

bool IsOver(const PeerView& view) {
  return !view.OwnerAlive() || !view.IsCurrent();
}

template <typename Health>
void ReadSide(const PeerView& view, protocol::MessageReader<Health>& reader,
              SeenSide<Health>& side) {
  side.heartbeat_ns = view.HeartbeatNs();
  Health health;
  if (reader.ReadLatest(health) == ReadStatus::kFresh) side.health = health;
}

}  // namespace

PairWatch::PairWatch(const std::string& instance)
    : haptic_request_{.instance = instance,
                      .role = protocol::Role::kHaptic,
                      .required = {},
                      .owners = {}},
      world_request_{
          .instance = instance, .role = protocol::Role::kWorld, .required = {}, .owners = {}} {
  LookForHaptic();
  LookForWorld();
}

void PairWatch::LookForHaptic() {
  if (haptic_view_ != nullptr && !IsOver(*haptic_view_)) return;
  if (haptic_view_ != nullptr) ReadTicks();  // its last words
  AttachResult result = protocol::Attach(haptic_request_);
  haptic_view_ = std::move(result.view);
  haptic_ = {};
  haptic_.attached = haptic_view_ != nullptr;
  haptic_.why = std::move(result.text);
  if (haptic_view_ == nullptr) return;
  haptic_.epoch = haptic_view_->epoch();
  tick_reader_ = haptic_view_->Reader<protocol::HapticTick>();
  haptic_health_reader_ = haptic_view_->Reader<protocol::HapticHealth>();
}

void PairWatch::LookForWorld() {
  if (world_view_ != nullptr && !IsOver(*world_view_)) return;
  AttachResult result = protocol::Attach(world_request_);
  world_view_ = std::move(result.view);
  world_ = {};
  world_.attached = world_view_ != nullptr;
  world_.why = std::move(result.text);
  if (world_view_ == nullptr) return;
  world_.epoch = world_view_->epoch();
  frame_reader_ = world_view_->Reader<protocol::WorldFrame>();
  world_health_reader_ = world_view_->Reader<protocol::WorldHealth>();
  bodies_ = protocol::BodiesReader(world_view_->Stream(StreamType::kWorldBodies));
  scenes_ = protocol::SceneReader(world_view_->Stream(StreamType::kWorldScene));
  frames_.clear();
  pending_ = {};
  stamps_ = {};
}

void PairWatch::Poll(std::int64_t now_ns) {
  if (now_ns - polled_ns_ < kPollNs) return;
  polled_ns_ = now_ns;
  if (now_ns - looked_ns_ >= kLookNs) {
    looked_ns_ = now_ns;
    LookForHaptic();
    LookForWorld();
  }
  // Ticks before frames: then every frame that a tick displays is known when its age is asked for.
  const std::uint64_t before = tick_count_;
  if (haptic_view_ != nullptr) {
    ReadTicks();
    ReadSide(*haptic_view_, haptic_health_reader_, haptic_);
  }
  if (world_view_ != nullptr) {
    ReadFrames();
    CompleteFrame(static_cast<std::uint64_t>(now_ns));
    ReadSide(*world_view_, world_health_reader_, world_);
    scenes_.ReadLatest();
  }
  AgeFeatures(before + 1);
}

void PairWatch::ReadTicks() {
  while (true) {
    const ReadStatus status = tick_reader_.ReadNext(tick_);
    if (status == ReadStatus::kRejected && !tick_reader_.hopeless()) continue;
    if (status != ReadStatus::kFresh) return;
    ticks_.push_back({.start_ns = tick_.start_ns,
                      .period_ns = tick_.period_ns,
                      .duration_ns = tick_.previous_duration_ns,
                      .frame = tick_.world_frame,
                      .tick = tick_.tick,
                      .feature_age_s = std::numeric_limits<double>::quiet_NaN(),
                      .pointer_count = tick_.pointer_count,
                      .pointers = tick_.pointers});
    ++tick_count_;
    if (ticks_.size() > kTicksKept) ticks_.pop_front();
  }
}

void PairWatch::ReadFrames() {
  protocol::WorldFrame frame;
  while (true) {
    const ReadStatus status = frame_reader_.ReadNext(frame);
    if (status == ReadStatus::kRejected && !frame_reader_.hopeless()) continue;
    if (status != ReadStatus::kFresh) return;
    const std::uint64_t stamp_ns = frame_reader_.received().stamp_ns;
    stamps_[frame.frame % stamps_.size()] = {frame.frame, stamp_ns};
    pending_.stamp_ns = stamp_ns;
    pending_.message = frame;
  }
}

void PairWatch::CompleteFrame(std::uint64_t now_ns) {
  bodies_.ReadLatest();
  const std::uint64_t bodies_ns = bodies_.received().stamp_ns;
  if (bodies_ns > pending_.stamp_ns + kSameMomentNs) ReadFrames();  // one came between the looks
  if (pending_.stamp_ns == 0) return;
  const bool may_come = now_ns < pending_.stamp_ns + kBodiesAwaitedNs;
  if (bodies_ns + kSameMomentNs < pending_.stamp_ns && may_come) return;
  const std::uint64_t earliest_ns = frames_.empty() ? 0 : frames_.back().state_ns + 1;
  pending_.sequence = ++frame_count_;
  pending_.state_ns = std::max(earliest_ns, StateTime(pending_.message, pending_.stamp_ns));
  pending_.bodies.assign(bodies_.bodies().begin(), bodies_.bodies().end());
  frames_.push_back(std::exchange(pending_, {}));
  if (frames_.size() > kFramesKept) frames_.pop_front();
}

std::uint64_t PairWatch::StateTime(const protocol::WorldFrame& frame,
                                   std::uint64_t stamp_ns) const {
  if (ticks_.empty() || frame.acked_epoch == 0 || frame.acked_epoch != haptic_.epoch) {
    return stamp_ns;
  }
  const SeenTick& newest = ticks_.back();
  const auto ticks_ago = static_cast<std::int64_t>(newest.tick - frame.acked_tick);
  std::uint64_t end_ns =
      newest.start_ns + newest.period_ns - static_cast<std::uint64_t>(ticks_ago) * newest.period_ns;
  if (ticks_ago >= 0 && static_cast<std::size_t>(ticks_ago) < ticks_.size()) {
    const SeenTick& acked = ticks_[ticks_.size() - 1 - static_cast<std::size_t>(ticks_ago)];
    if (acked.tick == frame.acked_tick) end_ns = acked.start_ns + acked.period_ns;
  }
  // A haptic side that fell silent is acknowledged for ever: its time no longer tells the world's.
  return end_ns <= stamp_ns && stamp_ns - end_ns < 2 * frame.period_ns ? end_ns : stamp_ns;
}

void PairWatch::AgeFeatures(std::uint64_t first_new) {
  const std::uint64_t first_kept = tick_count_ - ticks_.size() + 1;
  for (std::uint64_t i = std::max(first_new, first_kept); i <= tick_count_; ++i) {
    SeenTick& tick = ticks_[static_cast<std::size_t>(i - first_kept)];
    const Stamp& stamp = stamps_[tick.frame % stamps_.size()];
    if (tick.frame != 0 && stamp.frame == tick.frame && tick.start_ns >= stamp.stamp_ns) {
      tick.feature_age_s = Seconds(tick.start_ns - stamp.stamp_ns);
    }
  }
}

}  // namespace rikiseki::viewer
