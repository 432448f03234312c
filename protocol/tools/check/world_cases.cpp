// SPDX-License-Identifier: MIT
// A world under test: its segment, its planes, and what it takes of the impulses of a haptic side that is
// right.
#include "protocol/tools/check/world_cases.h"

#include <algorithm>
#include <cmath>

#include "common/clock.h"
#include "protocol/tools/check/lint.h"

namespace rikiseki::protocol::check {
namespace {

// No world lets one tick apply more than this force for its gap.
constexpr double kLargestCap = 1000;  // N

RawView Raw(HapticPlayer& player) {
  return RawView(player.instance(), Role::kWorld);
}

void Header(HapticPlayer& player) {
  Require(player.peer().Has(StreamType::kWorldFrame), "no stream world.frame");
  if (!player.peer().Has(StreamType::kWorldHealth)) NotStrict("no stream world.health");
  if (!player.peer().Has(StreamType::kWorldBodies)) NotStrict("no stream world.bodies");
}
void Reserved(HapticPlayer& player) {
  CheckReserved(Raw(player));
}
void Epoch(HapticPlayer& player) {
  CheckEpoch(Raw(player));
}
void Mode(HapticPlayer& player) {
  CheckPermissions(player.instance(), Role::kWorld);
}
void Heartbeat(HapticPlayer& player) {
  CheckHeartbeat(Raw(player), StreamType::kWorldFrame, 0.6);
}
void Publication(HapticPlayer& player) {
  CheckPublication(Raw(player), StreamType::kWorldFrame, 0.5);
}

void GoesOnAlone(HapticPlayer& player) {
  if (player.open()) player.Close();
  const std::size_t from = player.seen().size();
  player.Run(0.5);
  Require(player.seen().size() >= from + 3, "only " + std::to_string(player.seen().size() - from) +
                                                " frames in half a second without a haptic side");
  const auto& seen = player.seen();
  std::vector<std::int64_t> gaps;
  for (std::size_t i = from + 1; i < seen.size(); ++i) {
    gaps.push_back(seen[i].stamp_ns - seen[i - 1].stamp_ns);
  }
  std::sort(gaps.begin(), gaps.end());
  const std::int64_t median = gaps[gaps.size() / 2];
  const std::int64_t nominal = player.WorldPeriodNs();
  if (median > nominal + nominal / 2 || median < nominal / 2) {
    Inform("half of the frames take longer than " + Ms(median) + ", period_ns is " + Ms(nominal));
  }
}

void WorldPeriod(HapticPlayer& player) {
  player.Run(0.3);
  Require(player.WorldPeriodNs() <= 200'000'000,
          "period_ns is " + Ms(player.WorldPeriodNs()) + ", too slow for this kit");
}

void Attaches(HapticPlayer& player) {
  player.Open();
  const std::int64_t start = MonotonicNow();
  player.Couple();
  const std::int64_t took = MonotonicNow() - start;
  Require(took <= 1'500'000'000 + 2 * player.WorldPeriodNs(),
          "acknowledges our segment only after " + Ms(took));
}

void AckAdvances(HapticPlayer& player) {
  player.Couple();
  player.Run(0.1);
  Require(player.Settle(),
          "ticks are not acknowledged: " + std::to_string(player.newest().acked_tick) + " of " +
              std::to_string(player.tick()));
}

void Planes(HapticPlayer& player) {
  player.Touch();
  const Plane& plane = player.touched();
  const Vector outside = Sum(plane.point, Scaled(plane.normal, 0.005 + player.radius));
  player.position = outside;
  player.Run(player.Frames(3) + 0.05);
  bool seen = false;
  for (std::uint32_t i = 0; i < player.newest().plane_count; ++i) {
    const Plane& now = player.newest().planes[i];
    if (now.pointer != 0 || now.body != plane.body) continue;
    seen = true;
    const double front = Dot(Difference(outside, now.point), now.normal);
    const double behind = Dot(Difference(player.target(), now.point), now.normal);
    Require(front > 0, "a normal points into the body: the finger outside is " + Num(front) +
                           " m in front of its plane");
    Require(behind < 0, "the target lies in front of the box's plane");
  }
  Require(seen, "no plane for a finger 5 mm in front of the box");
}

// SPEC.md 10: half extents of 0.03 m.
void Box(HapticPlayer& player) {
  player.Touch();
  const double half =
      std::abs(Dot(Difference(player.touched().point, player.target()), player.touched().normal));
  if (std::abs(half - 0.03) > 2e-3) {
    Inform("the box's face is " + Num(half) + " m from the target, the scene wants 0.03");
  }
}

void FarAway(HapticPlayer& player) {
  player.Touch();
  player.position = Sum(player.target(), {-100, 0, 0});
  player.Run(player.Frames(3) + 0.05);
  std::uint32_t near_box = 0;
  for (std::uint32_t i = 0; i < player.newest().plane_count; ++i) {
    if (player.newest().planes[i].body == player.touched().body) ++near_box;
  }
  if (near_box > 0) Inform("planes of a box 100 m away are sent");
}

/// Pushes back and forth by `impulse` and lets everything be taken.
void PushAndBack(HapticPlayer& player, double impulse) {
  player.each_tick = {Units(impulse / 50), Units(-impulse / 150), Units(impulse / 500)};
  player.Run(0.05);
  for (std::int64_t& axis : player.each_tick) axis = -axis;
  player.Run(0.05);
  player.each_tick = {};
  Require(player.Settle(), "ticks are not acknowledged");
}

void TakesTotals(HapticPlayer& player) {
  player.Touch();
  const std::uint64_t looks = player.monitor().looks(kSum);
  const std::uint64_t breaches = player.monitor().breaches(kSum);
  PushAndBack(player, 0.05);
  Require(player.monitor().looks(kSum) > looks, "no frame acknowledged us");
  if (player.monitor().breaches(kSum) > breaches) player.monitor().Report(kSum);
}

/// The body moves along the impulse that acts on it.
void Direction(HapticPlayer& player) {
  player.Touch();
  if (!player.Movable()) Unimplemented("the box cannot move");
  const Coupling coupling = player.newest().coupling;
  if (coupling == Coupling::kPosition) Unimplemented("coupling position does not use impulses");
  const double impulse = 0.4 * player.BodyOf(player.touched().body)->mass;
  double most = 0;
  player.position = Sum(player.target(), {-0.1, 0, 0});
  for (int i = 0; i < 40; ++i) player.Push({Units(impulse / 40), 0, 0}), player.Run(0.001);
  player.Until(
      [&] {
        const auto body = player.BodyOf(player.touched().body);
        if (body && std::abs(body->velocity[0]) > std::abs(most)) most = body->velocity[0];
        return false;
      },
      0.25);
  for (int i = 0; i < 40; ++i) player.Push({Units(-impulse / 40), 0, 0}), player.Run(0.001);
  player.Settle();
  Require(most > 0, "an impulse along +x moved the body with " + Num(most) + " m/s along x");
}

// Everything before the world came is not its business, however large.
void Baseline(HapticPlayer& player) {
  player.Touch();
  const std::uint32_t body = player.touched().body;
  const std::uint32_t generation = player.touched().generation;
  player.Close();
  player.Open({}, SegmentState::kInitialising);
  player.publishing = true;
  player.OpenChannel(body, generation);
  player.channels.front().opened_tick = 0;
  player.channels.front().impulse = {Units(30), Units(-20), Units(10)};
  player.Run(0.1);
  player.Push({Units(5), 0, 0});
  player.Run(0.1);
  const std::uint64_t breaches = player.monitor().breaches(kSum);
  player.segment().SetState(SegmentState::kReady);
  player.Couple();
  player.Run(0.1);
  Require(player.Settle(), "ticks are not acknowledged");
  if (player.monitor().breaches(kSum) > breaches) player.monitor().Report(kSum);
}

void LateChannel(HapticPlayer& player) {
  player.Touch();
  const std::uint64_t breaches = player.monitor().breaches(kSum);
  // A second pointer's channel, which begins with its first increment.
  Channel& channel = player.OpenChannel(player.touched().body, player.touched().generation);
  channel.pointer = 1;
  channel.impulse = {Units(0.001), 0, 0};
  player.Run(0.1);
  player.channels.back().state = ChannelState::kClosed;
  Require(player.Settle(), "ticks are not acknowledged");
  // Acknowledged, so its place may be used again; the same body, from zero.
  player.channels.pop_back();
  player.Run(0.02);
  Channel& again = player.OpenChannel(player.touched().body, player.touched().generation);
  again.pointer = 1;
  again.impulse = {Units(-0.001), 0, 0};
  player.Run(0.1);
  Require(player.Settle(), "ticks are not acknowledged");
  player.channels.pop_back();
  if (player.monitor().breaches(kSum) > breaches) player.monitor().Report(kSum);
}

void Modulo(HapticPlayer& player) {
  player.Touch();
  const Plane box = player.touched();
  player.Close();
  player.Open();
  player.OpenChannel(box.body, box.generation);
  player.channels.front().impulse = {INT64_MAX - Units(0.001), INT64_MIN + Units(0.001), 0};
  player.Couple();
  Require(player.Settle(), "ticks are not acknowledged");
  const std::uint64_t breaches = player.monitor().breaches(kSum);
  player.each_tick = {Units(0.0001), Units(-0.0001), 0};
  player.Run(0.03);
  player.each_tick = {Units(-0.0001), Units(0.0001), 0};
  player.Run(0.03);
  player.each_tick = {};
  Require(player.Settle(), "ticks are not acknowledged");
  if (player.monitor().breaches(kSum) > breaches) player.monitor().Report(kSum);
}

/// What `act` makes the world apply, on a settled world.
ImpulseUnits AppliedBy(HapticPlayer& player, const std::function<void()>& act) {
  Require(player.Settle(), "ticks are not acknowledged");
  const ImpulseUnits before = player.newest().applied;
  act();
  player.Run(0.02);
  Require(player.Settle(), "ticks are not acknowledged");
  return Minus(player.newest().applied, before);
}

void Gap(HapticPlayer& player) {
  player.Touch();
  const std::uint64_t breaches = player.monitor().breaches(kSum);
  const double gap = std::max(0.1, player.Frames(3));
  const ImpulseUnits applied = AppliedBy(player, [&] {
    player.publishing = false;
    player.Run(0.3);
    player.publishing = true;
    player.Push({Units(1e5), 0, 0});
  });
  Require(Largest(applied) * kImpulseUnit <= kLargestCap * gap,
          Num(Largest(applied) * kImpulseUnit) + " N s were applied at once after a gap");
  if (player.monitor().breaches(kSum) > breaches) player.monitor().Report(kSum);
}

void ForeignWorld(HapticPlayer& player) {
  player.Touch();
  const ImpulseUnits applied = AppliedBy(player, [&] {
    player.named_epoch = player.peer().epoch() - 1000;
    player.each_tick = {Units(0.001), 0, 0};
    player.Run(0.1);
    player.each_tick = {};
    player.Run(0.005);
    player.named_epoch = 0;
  });
  Require(Largest(applied) == 0,
          "applied " + Text(applied) + " of what was displayed against another world");
}

void UnknownBody(HapticPlayer& player) {
  player.Touch();
  const std::uint64_t breaches = player.monitor().breaches(kSum);
  const ImpulseUnits applied = AppliedBy(player, [&] {
    player.OpenChannel(4'000'000'000U, 1).impulse = {Units(0.01), 0, 0};
    player.Run(0.1);
  });
  player.channels.pop_back();
  Require(Largest(applied) == 0, "applied " + Text(applied) + " to a body that there is not");
  if (player.monitor().breaches(kSum) > breaches) player.monitor().Report(kSum);
}

void OldGeneration(HapticPlayer& player) {
  player.Touch();
  const std::uint64_t breaches = player.monitor().breaches(kSum);
  const ImpulseUnits applied = AppliedBy(player, [&] {
    player.OpenChannel(player.touched().body, player.touched().generation + 1000).impulse = {
        Units(0.01), 0, 0};
    player.Run(0.1);
  });
  player.channels.pop_back();
  Require(Largest(applied) == 0, "applied " + Text(applied) + " to another generation of the body");
  if (player.monitor().breaches(kSum) > breaches) player.monitor().Report(kSum);
}

void Immovable(HapticPlayer& player) {
  player.Touch();
  const auto body = player.BodyOf(player.touched().body);
  if (!body) Unimplemented("no stream world.bodies that tells what can move");
  if (body->mass > 0) Unimplemented("the box can move");
  const ImpulseUnits applied = AppliedBy(player, [&] {
    player.each_tick = {Units(0.001), 0, 0};
    player.Run(0.1);
    player.each_tick = {};
  });
  Require(Largest(applied) == 0, "applied " + Text(applied) + " to a body that cannot move");
}

void OldTick(HapticPlayer& player) {
  player.Touch();
  const std::uint64_t breaches = player.monitor().breaches(kSum);
  const ImpulseUnits applied = AppliedBy(player, [&] {
    // The tick before, said again with larger totals; then the truth goes on.
    HapticTick old = player.NextTick();
    player.Publish(old);
    old.channels[0].impulse = Plus(old.channels[0].impulse, {Units(0.01), 0, 0});
    std::vector<std::uint64_t> words(kHapticTickBytes / 8);
    const Encoded shape = Encode(old, words);
    words.resize(shape.used_bytes / 8);
    player.writer().Publish(words, shape, static_cast<std::uint64_t>(MonotonicNow()));
    player.Run(0.1);
  });
  Require(Largest(applied) == 0, "a tick that was said twice was taken twice: " + Text(applied));
  if (player.monitor().breaches(kSum) > breaches) player.monitor().Report(kSum);
}

void Lapped(HapticPlayer& player) {
  player.Touch();
  const Plane box = player.touched();
  player.Close();
  player.Open({}, SegmentState::kReady, 8);
  player.OpenChannel(box.body, box.generation);
  player.Couple();
  const std::uint64_t breaches = player.monitor().breaches(kSum);
  PushAndBack(player, 0.02);
  if (player.monitor().breaches(kSum) > breaches) player.monitor().Report(kSum);
  // Health is published a few times a second (6.3): the count may come after the ticks.
  auto health = player.Health();
  for (int wait = 0; wait < 20 && health && health->lapped == 0; ++wait) {
    player.Run(0.05);
    health = player.Health();
  }
  player.Close();
  if (health && health->lapped == 0 && player.WorldPeriodNs() > 10'000'000) {
    Fail("ticks were overwritten unread, and world.health counts none as lapped");
  }
}

void Health(HapticPlayer& player) {
  if (!player.peer().Has(StreamType::kWorldHealth)) Unimplemented("no stream world.health");
  player.Touch();
  PushAndBack(player, 0.01);
  Require(player.Until([&] { return player.Health().has_value(); }, 2), "never published");
  player.Run(0.3);
  const WorldHealth health = *player.Health();
  if (health.peer_epoch != player.segment().epoch()) NotStrict("peer_epoch is not ours");
  if (health.peer_state != PeerState::kLive && health.peer_state != PeerState::kLate) {
    NotStrict("peer_state is " + std::to_string(static_cast<std::uint32_t>(health.peer_state)) +
              " while it takes our ticks");
  }
  if (health.coupling != player.newest().coupling) NotStrict("coupling is not the frames'");
  if (health.frames == 0) NotStrict("frames is 0");
}

void Bodies(HapticPlayer& player) {
  if (!player.peer().Has(StreamType::kWorldBodies)) Unimplemented("no stream world.bodies");
  player.Touch();
  const auto body = player.BodyOf(player.touched().body);
  Require(body.has_value(), "the body of our plane is not in world.bodies");
  Require(body->generation == player.touched().generation,
          "the plane names generation " + std::to_string(player.touched().generation) +
              ", world.bodies " + std::to_string(body->generation));
}

constexpr WorldCase kSegmentCases[] = {
    {"world/3.2-5/streams", Header},      {"world/3.1-8/reserved", Reserved},
    {"world/5.2-10/epoch", Epoch},        {"world/5.1-1/mode", Mode},
    {"world/3.1-4/heartbeat", Heartbeat}, {"world/4.1-2/published", Publication},
    {"world/5.5-5/alone", GoesOnAlone},   {"world/10-7/period", WorldPeriod},
};

constexpr WorldCase kContactCases[] = {
    {"world/5.3-3/attaches", Attaches},
    {"world/7.5-2/ack-advances", AckAdvances},
    {"world/6.2-5/planes", Planes},
    {"world/10-1/box", Box},
    {"world/6.2-6/far-away", FarAway},
    {"world/6.2-7/generation", Bodies},
    {"world/7.4-1/totals", TakesTotals},
    {"world/7.2-2/direction", Direction},
    {"world/7.4-2/baseline", Baseline},
    {"world/7.4-3/late-channel", LateChannel},
    {"world/7.1-2/modulo", Modulo},
    {"world/7.4-5/gap", Gap},
    {"world/7.4-4/foreign-world", ForeignWorld},
    {"world/7.4-6/unknown-body", UnknownBody},
    {"world/7.4-6/old-generation", OldGeneration},
    {"world/7.4-6/immovable", Immovable},
    {"world/7.4-9/old-tick", OldTick},
    {"world/4.4-1/lapped", Lapped},
    {"world/6.3-1/health", Health},
};

template <const char* kId>
void Monitored(HapticPlayer& player) {
  if (player.monitor().looks(kId) == 0) {
    player.Touch();
    PushAndBack(player, 0.01);
  }
  player.monitor().Report(kId);
}

constexpr WorldCase kMonitorCases[] = {
    {kFrameSequence, Monitored<kFrameSequence>},
    {kFrameStamps, Monitored<kFrameStamps>},
    {kFrameSound, Monitored<kFrameSound>},
    {kFrameNumbers, Monitored<kFrameNumbers>},
    {kUnitNormals, Monitored<kUnitNormals>},
    {kBaselineRange, Monitored<kBaselineRange>},
    {kBaselineKept, Monitored<kBaselineKept>},
    {kAckForward, Monitored<kAckForward>},
    {kAckEpoch, Monitored<kAckEpoch>},
    {kSum, Monitored<kSum>},
    {kRefused, Monitored<kRefused>},
};

}  // namespace

std::span<const WorldCase> WorldSegmentCases() {
  return kSegmentCases;
}
std::span<const WorldCase> WorldContactCases() {
  return kContactCases;
}
std::span<const WorldCase> WorldMonitorCases() {
  return kMonitorCases;
}

}  // namespace rikiseki::protocol::check
