// SPDX-License-Identifier: MIT
// A haptic side under test, with a world that is late, falls silent, dies, closes or starts again: the
// force goes to zero in the stated time, counted on the haptic side's own clock.
#include <algorithm>

#include "common/clock.h"
#include "protocol/tools/check/haptic_cases.h"

namespace rikiseki::protocol::check {
namespace {

/// One after the last tick from `from` on that displays a force.
std::size_t EndOfForce(const std::vector<SeenTick>& seen, std::size_t from) {
  std::size_t end = from;
  for (std::size_t i = from; i < seen.size(); ++i) {
    if (Norm(seen[i].force) >= kZeroForce) end = i + 1;
  }
  return end;
}

/// What the haptic side's own deadlines cost it between two ticks: longer ones are not its slowness to
/// decide but its host's.
std::int64_t StallsNs(const std::vector<SeenTick>& seen, std::size_t from, std::size_t to) {
  std::int64_t stalls = 0;
  for (std::size_t i = from + 1; i <= to && i < seen.size(); ++i) {
    stalls += std::max<std::int64_t>(seen[i].duration_ns - 2 * seen[i].period_ns, 0);
  }
  return stalls;
}

/// Waits for the bound to pass after the world ended at `end_ns`, and some more, in which the force
/// must not come back.
void RequireZeroWithin(WorldPlayer& player, std::size_t from, std::int64_t end_ns,
                       std::int64_t bound_ns, const std::string& what) {
  player.Run(static_cast<double>(end_ns + bound_ns + 200'000'000 - MonotonicNow()) * 1e-9);
  const auto& seen = player.seen();
  const std::size_t zero = EndOfForce(seen, from);
  Require(zero < seen.size(), what + ", and " + Ms(seen.back().start_ns - end_ns) +
                                  " later there are " + Num(player.Force()) + " N");
  const std::int64_t begin = std::max(end_ns, seen[from].start_ns);
  const std::int64_t took =
      seen[zero].start_ns - begin - StallsNs(seen, from, zero) - 3 * seen[zero].period_ns;
  Require(took <= bound_ns,
          what + ": zero force only after " + Ms(took) + ", " + Ms(bound_ns) + " is the bound");
}

void CheckStated(WorldPlayer& player, std::int64_t bound) {
  const std::int64_t table =
      std::max<std::int64_t>(5 * player.period_ns, 250'000'000) + 100'000'000;
  const std::int64_t ticks = 10 * player.seen().back().period_ns;
  if (bound > table + ticks) {
    NotStrict("zero_force_after_ns states " + Ms(bound) + ", the table " + Ms(table));
  }
}

void Late(WorldPlayer& player) {
  player.Press();
  player.publishing = false;
  const std::int64_t pause = MonotonicNow();
  // Late is 2.5 P = 50 ms, lost 250 ms.
  player.Run(0.15);
  const auto& seen = player.seen();
  std::size_t looks = 0;
  const Plane plane = player.planes[0];
  for (const SeenTick& tick : seen) {
    if (tick.start_ns < pause + 70'000'000 || tick.start_ns > pause + 200'000'000) continue;
    const double gap = Dot(Difference(tick.position, plane.point), plane.normal) - tick.radius;
    if (gap > -0.0001) continue;
    ++looks;
    Require(
        Norm(tick.force) >= kZeroForce,
        "the surface is not held: no force " + Ms(tick.start_ns - pause) + " after the last frame");
  }
  player.publishing = true;
  const std::uint64_t frame = player.frame();
  Require(player.Until([&] { return player.newest().world_frame > frame; }, 1),
          "frames after a late one are not displayed");
  if (looks == 0) Inform("the finger left the surface meanwhile");
}

void Silence(WorldPlayer& player) {
  player.Press();
  const std::int64_t bound = player.ZeroForceBoundNs();
  player.publishing = false;  // heartbeats go on: it is the frames that count
  const std::int64_t end = MonotonicNow();
  RequireZeroWithin(player, player.seen().size() - 1, end, bound, "the world fell silent");
  CheckStated(player, bound);
}

void Returns(WorldPlayer& player) {
  player.Press();
  player.publishing = player.beating = false;
  Require(player.Until([&] { return player.Force() < kZeroForce; }, 3), "the force stays");
  player.publishing = player.beating = true;
  Require(player.Until([&] { return player.DisplaysUs() && player.Force() > 0.05; }, 3),
          "the same world goes on, and no force comes back");
}

void Death(WorldPlayer& player) {
  player.Press();
  const std::int64_t bound = player.ZeroForceBoundNs();
  player.Die();
  RequireZeroWithin(player, player.seen().size() - 1, MonotonicNow(), bound, "the world died");
}

void MidWrite(WorldPlayer& player) {
  constexpr std::uint32_t kGhost = 666;
  player.Press();
  player.judge().PoisonBody(kGhost);
  const std::uint64_t breaches = player.monitor().breaches(kNeverShown);
  const std::int64_t bound = player.ZeroForceBoundNs();
  WorldFrame frame = player.NextFrame();
  for (std::uint32_t i = 0; i < frame.plane_count; ++i) frame.planes[i].body = kGhost;
  std::vector<std::uint64_t> words(kWorldFrameBytes / 8);
  const Encoded shape = Encode(frame, words);
  words.resize(shape.used_bytes / 8);
  player.writer().PublishPartly(words, shape, 3);
  player.Die();
  RequireZeroWithin(player, player.seen().size() - 1, MonotonicNow(), bound,
                    "the world died while it wrote a frame");
  Require(player.monitor().breaches(kNeverShown) == breaches, "the unfinished frame is displayed");
}

void Closes(WorldPlayer& player) {
  player.Press();
  player.Close();
  // `state` is looked at in every tick, so there is no wait for lost.
  RequireZeroWithin(player, player.seen().size() - 1, MonotonicNow(), 100'000'000 + 20'000'000,
                    "the world closed its segment");
}

void Restarts(WorldPlayer& player) {
  player.Press();
  const std::uint64_t before = player.segment().epoch();
  player.Die();
  player.Open();
  player.Couple();
  Require(player.segment().epoch() > before, "the kit's epochs must grow");
  const HapticTick tick = player.newest();
  const auto opened_before = std::find_if(
      player.seen().begin(), player.seen().end(),
      [&](const SeenTick& seen) { return seen.world_epoch == player.segment().epoch(); });
  for (std::uint32_t i = 0; i < tick.channel_count; ++i) {
    Require(tick.channels[i].opened_tick + 1 >= opened_before->tick,
            "a channel of the old world is still there: opened by tick " +
                std::to_string(tick.channels[i].opened_tick) + ", the new one is displayed since " +
                std::to_string(opened_before->tick));
  }
  Require(player.Until([&] { return player.Force() > 0.05; }, 3), "no force from the new world");
}

void Faulted(WorldPlayer& player) {
  player.Press();
  player.segment().SetState(SegmentState::kFaulted);
  const bool zero = player.Until([&] { return player.Force() < kZeroForce; }, 1);
  player.segment().SetState(SegmentState::kReady);
  Require(zero, "state is faulted, and the force stays");
  Require(player.Until([&] { return player.DisplaysUs() && player.Force() > 0.05; }, 3),
          "the fault went, and it does not display us again");
}

constexpr HapticCase kCases[] = {
    {"haptic/5.4-1/late", Late},        {"haptic/5.5-2/silence", Silence},
    {"haptic/5.5-6/returns", Returns},  {"haptic/5.5-1/death", Death},
    {"haptic/7.6-3/restart", Restarts}, {"haptic/4.2-1/mid-write", MidWrite},
    {"haptic/5.4-1/closes", Closes},    {"haptic/5.4-4/faulted", Faulted},
};

}  // namespace

std::span<const HapticCase> HapticEndCases() {
  return kCases;
}

}  // namespace rikiseki::protocol::check
