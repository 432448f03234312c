// SPDX-License-Identifier: MIT
#include "protocol/tools/check/world_player.h"

#include <algorithm>
#include <atomic>
#include <cmath>

#include "common/clock.h"

namespace rikiseki::protocol::check {
namespace {

constexpr std::int64_t kStepNs = 1'000'000;
constexpr double kApproachPerFrame = 0.0004;  // m
constexpr double kPressForce = 0.5;           // N: enough to be seen, gentle for a person
constexpr std::int64_t kRestNs = 80'000'000;  // at rest when the force holds this long
constexpr double kFarthestPress = 0.04;       // m

}  // namespace

WorldPlayer::WorldPlayer(const PlayOptions& options, double patience_s)
    : options_(options),
      role_(options.instance, Role::kWorld, options.runtime_directory),
      peer_(WaitForPeer(options.instance, Role::kHaptic, patience_s)),
      ticks_(peer_->Reader<HapticTick>()),
      healths_(peer_->Reader<HapticHealth>()) {}

WorldPlayer::~WorldPlayer() {
  if (open()) Close();
}

double WorldPlayer::Force() const {
  return newest().pointer_count == 0 ? 0 : Norm(newest().pointers[0].force);
}

bool WorldPlayer::DisplaysUs() const {
  return open() && newest().world_epoch == segment_->epoch();
}

std::optional<HapticHealth> WorldPlayer::Health() {
  if (!peer_->Has(StreamType::kHapticHealth)) return std::nullopt;
  if (healths_.ReadLatest(health_) == ReadStatus::kFresh) any_health_ = true;
  if (!any_health_) return std::nullopt;
  return health_;
}

std::int64_t WorldPlayer::ZeroForceBoundNs() {
  const std::int64_t table = std::max<std::int64_t>(5 * period_ns, 250'000'000) + 100'000'000;
  const auto health = Health();
  if (!health || health->zero_force_after_ns == 0) return table;
  return static_cast<std::int64_t>(health->zero_force_after_ns);
}

void WorldPlayer::Open(const std::function<void(SegmentHeader&)>& alter, SegmentState state,
                       std::uint32_t slots) {
  if (open()) Die();
  segment_.reset();
  segment_ = std::make_unique<PlayedSegment>(
      SegmentScript{.instance = options_.instance,
                    .role = Role::kWorld,
                    .streams = {{StreamType::kWorldFrame, kWorldFrameBytes, slots,
                                 static_cast<std::uint64_t>(period_ns)}},
                    .epoch = role_.NextEpoch(),
                    .state = state,
                    .alter = alter});
  writer_ = RawWriter(segment_->RingOf(StreamType::kWorldFrame));
  frame_ = 0;
  next_frame_ns_ = 0;
  publishing = beating = acking = true;
  amend = nullptr;
  animate = nullptr;
  // What the haptic side still says is the old world's: the first message is a baseline only.
  Drain();
  any_tick_ = false;
  applied_ = discarded_ = {};
  totals_.clear();
  frozen_ack_.reset();
}

void WorldPlayer::Leave() {
  if (open()) Close();
  planes.clear();
  Until([&] { return Force() < kZeroForce; }, 1);
}

void WorldPlayer::NeverTaken(const std::function<void(SegmentHeader&)>& alter, SegmentState state,
                             const std::string& what) {
  Open(alter, state);
  const std::size_t from = seen().size();
  Run(0.3);
  for (std::size_t i = from; i < seen().size(); ++i) {
    Require(seen()[i].world_epoch != segment_->epoch(), "frames are displayed though " + what);
    Require(Norm(seen()[i].force) < kZeroForce, "force though " + what);
  }
}

void WorldPlayer::Book(const HapticTick& tick) {
  if (!open()) return;
  const Totals now = TotalsOf(tick);
  if (!any_tick_) {
    any_tick_ = true;
    baseline_tick_ = tick.tick;
  } else if (tick.world_epoch == segment_->epoch()) {
    applied_ = Plus(applied_, Growth(totals_, now));
  } else {
    discarded_ = Plus(discarded_, Growth(totals_, now));
  }
  totals_ = now;
  acked_tick_ = tick.tick;
}

void WorldPlayer::Drain() {
  for (;;) {
    const ReadStatus status = ticks_.ReadNext(tick_);
    if (status == ReadStatus::kFresh) {
      judge_.Tick(tick_, ticks_.received());
      Book(tick_);
      pace_.Note(static_cast<std::int64_t>(tick_.previous_duration_ns));
      continue;
    }
    monitor_.Judge(kSound, status != ReadStatus::kRejected, [&] {
      return std::string("message ") + std::to_string(ticks_.received().number) + ": " +
             Describe(ticks_.refusal());
    });
    monitor_.Judge(kSequence, status != ReadStatus::kBackwards,
                   [] { return std::string("published of haptic.tick ran backwards"); });
    if (ticks_.ring().cursor() > 0 && status == ReadStatus::kBackwards) {
      ticks_ = peer_->Reader<HapticTick>();
    }
    if (status != ReadStatus::kRejected) return;
  }
}

WorldFrame WorldPlayer::NextFrame() {
  WorldFrame frame;
  frame.frame = ++frame_;
  frame.world_time_ns = frame_ * static_cast<std::uint64_t>(period_ns);
  frame.period_ns = static_cast<std::uint64_t>(period_ns);
  if (any_tick_) {
    frame.acked_epoch = peer_->epoch();
    frame.acked_tick = acked_tick_;
    frame.baseline_tick = baseline_tick_;
    frame.applied = applied_;
    frame.discarded = discarded_;
  }
  if (acking || !frozen_ack_) {
    frozen_ack_ = frame;
  } else {
    frame.acked_epoch = frozen_ack_->acked_epoch;
    frame.acked_tick = frozen_ack_->acked_tick;
    frame.baseline_tick = frozen_ack_->baseline_tick;
    frame.applied = frozen_ack_->applied;
    frame.discarded = frozen_ack_->discarded;
  }
  frame.coupling = Coupling::kImpulse;
  frame.plane_count = static_cast<std::uint32_t>(std::min<std::size_t>(planes.size(), kMaxPlanes));
  std::copy_n(planes.begin(), frame.plane_count, frame.planes.begin());
  return frame;
}

void WorldPlayer::Publish(const WorldFrame& frame) {
  const bool honest = frame.acked_epoch == peer_->epoch() && frame.acked_tick <= acked_tick_;
  judge_.FramePublished(segment_->epoch(), frame.frame, honest ? frame.acked_tick : 0,
                        std::span(frame.planes).first(frame.plane_count));
  std::vector<std::uint64_t> words(kWorldFrameBytes / 8);
  const Encoded encoded = Encode(frame, words);
  writer_.Publish(std::span<const std::uint64_t>(words).first(encoded.used_bytes / 8), encoded,
                  static_cast<std::uint64_t>(MonotonicNow()));
}

void WorldPlayer::PublishSpoilt(
    const WorldFrame& frame,
    const std::function<void(std::vector<std::uint64_t>&, Encoded&)>& spoil,
    std::int64_t stamp_offset_ns) {
  judge_.Poison(segment_->epoch(), frame.frame);
  std::vector<std::uint64_t> words(kWorldFrameBytes / 8);
  Encoded encoded = Encode(frame, words);
  spoil(words, encoded);
  const std::size_t room = writer_.ring().payload_bytes;
  const std::size_t stored = std::min<std::size_t>(encoded.used_bytes, room) / 8;
  writer_.Publish(std::span<const std::uint64_t>(words).first(stored), encoded,
                  static_cast<std::uint64_t>(MonotonicNow() + stamp_offset_ns));
}

void WorldPlayer::Jump(std::uint64_t numbers) {
  frame_ += numbers;
  writer_.SetPublished(writer_.published() + numbers);
}

void WorldPlayer::Step() {
  const std::int64_t now = pace_.Step(*peer_, Role::kHaptic);
  Drain();
  if (const auto health = Health()) judge_.SetSlewLimit(health->slew_limit);
  if (open() && beating) {
    segment_->Heartbeat(frame_, static_cast<std::uint64_t>(now));
  }
  if (open() && publishing && now >= next_frame_ns_) {
    next_frame_ns_ = std::max(next_frame_ns_ + period_ns, now + period_ns / 2);
    if (animate) animate();
    WorldFrame frame = NextFrame();
    if (amend) amend(frame);
    Publish(frame);
  }
  SleepUntil(now + kStepNs);
}

void WorldPlayer::Run(double seconds) {
  Until([] { return false; }, seconds);
}

bool WorldPlayer::Until(const std::function<bool()>& done, double seconds) {
  return pace_.Until([this] { Step(); }, done, seconds);
}

void WorldPlayer::Couple() {
  if (!open()) Open();
  publishing = beating = acking = true;
  amend = nullptr;
  Require(Until([&] { return newest().world_epoch == segment_->epoch(); }, 5),
          "5 s after our segment is ready it still names no frame of it");
  Require(newest().pointer_count > 0, "it has no pointer");
}

void WorldPlayer::Press() {
  if (open() && DisplaysUs() && planes.size() == 1 && Force() >= kPressForce / 2) return;
  Couple();
  const Pointer finger = newest().pointers[0];
  Vector normal{};
  if (options_.has_target) {
    const Vector target{options_.target[0], options_.target[1], options_.target[2]};
    const Vector away = Difference(finger.position, target);
    normal = Norm(away) > 1e-6 ? Scaled(away, 1 / Norm(away)) : Vector{0, 0, 1};
  } else {
    // Across the finger's place, so that the force has a moment about the world's origin.
    std::size_t axis = 2;
    double most = 0;
    for (const std::size_t candidate : {2U, 1U, 0U}) {
      Vector direction{};
      direction[candidate] = 1;
      const double lever = Norm(Cross(finger.position, direction));
      if (lever > most + 1e-3) {
        most = lever;
        axis = candidate;
      }
    }
    normal[axis] = 1;
  }
  Plane plane;
  plane.pointer = finger.pointer;
  plane.body = body;
  plane.generation = generation;
  plane.feature = 1;
  plane.normal = normal;
  double depth = -0.002;  // m, of the finger's sphere at its place now
  plane.point = options_.has_target
                    ? Vector{options_.target[0], options_.target[1], options_.target[2]}
                    : Sum(finger.position, Scaled(normal, depth - finger.radius));
  planes = {plane};
  if (!options_.has_target) {
    animate = [this, finger, normal, depth]() mutable {
      const double force = Force();
      if (force >= kPressForce || depth > kFarthestPress) return;
      depth += force < kZeroForce ? kApproachPerFrame : kApproachPerFrame / 4;
      planes[0].point = Sum(finger.position, Scaled(normal, depth - finger.radius));
    };
  }
  // A finger that yields bounces before it rests against the surface; one that presses by a script
  // comes and goes.
  bool felt = false;
  std::int64_t since = 0;
  const bool rests = Until(
      [&] {
        felt = felt || Force() >= kPressForce;
        if (Force() < kPressForce / 2) since = MonotonicNow();
        return felt && MonotonicNow() - since > kRestNs;
      },
      6);
  animate = nullptr;
  Require(felt, "no force after our surface was brought into the finger");
  if (!rests) {
    Require(Until([&] { return Force() >= kPressForce / 2; }, 6), "the force does not come again");
  }
}

void WorldPlayer::Release() {
  planes.clear();
  animate = nullptr;
  if (!open()) return;
  Require(Until([&] { return Force() < kZeroForce; }, 3),
          "still " + Num(Force()) + " N, 3 s after every surface went away");
}

}  // namespace rikiseki::protocol::check
