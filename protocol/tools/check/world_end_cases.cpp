// SPDX-License-Identifier: MIT
// A world under test, with a haptic side that falls silent, closes, dies or starts again: nothing that it
// displayed is lost, nothing is taken twice, and the world goes on.
#include <string>
#include <vector>

#include "protocol/tools/check/world_cases.h"

namespace rikiseki::protocol::check {
namespace {

void Silent(HapticPlayer& player) {
  player.Touch();
  player.each_tick = {Units(0.0005), 0, 0};
  player.Run(0.05);
  player.each_tick = {Units(-0.0005), 0, 0};
  player.Run(0.05);
  player.publishing = false;
  Require(player.Settle(1), "the last ticks are not acknowledged");
  const WorldFrame before = player.newest();
  player.Run(player.Frames(5) + 0.1);
  const WorldFrame after = player.newest();
  Require(after.frame > before.frame + 2, "frames end when the haptic side falls silent");
  Require(after.applied == before.applied && after.discarded == before.discarded,
          "impulses are applied while the haptic side is silent");
  const auto health = player.Health();
  player.publishing = true;
  player.each_tick = {};
  Require(player.Settle(), "the same haptic side goes on, and is not acknowledged");
  if (health && health->peer_state == PeerState::kLive) {
    NotStrict("world.health says live of a haptic side that is silent");
  }
}

/// Ends at once after a push, and starts again; the old epoch's last tick must be in a frame.
void LastWords(HapticPlayer& player, bool cleanly, const char* what) {
  player.Touch();
  const Plane box = player.touched();
  Require(player.Settle(), "ticks are not acknowledged");
  player.publishing = false;
  const std::uint64_t sums = player.monitor().breaches(kSum);
  for (int i = 0; i < 10; ++i) {
    player.Push({Units(i % 2 == 0 ? 0.002 : -0.001), 0, 0});
    player.Publish(player.NextTick());
  }
  const std::uint64_t old_epoch = player.segment().epoch();
  const std::uint64_t last = player.tick();
  const std::size_t from = player.seen().size();
  if (cleanly)
    player.Close();
  else
    player.Die();
  player.Open();
  player.OpenChannel(box.body, box.generation);
  player.Couple();
  bool heard = false;
  for (std::size_t i = from; i < player.seen().size(); ++i) {
    const WorldFrame& frame = player.seen()[i].frame;
    heard = heard || (frame.acked_epoch == old_epoch && frame.acked_tick == last);
  }
  Require(heard, std::string(what) + ": its last tick " + std::to_string(last) +
                     " was never acknowledged");
  player.Run(0.02);
  Require(player.Settle(), "the new epoch is not acknowledged");
  if (player.monitor().breaches(kSum) > sums) player.monitor().Report(kSum);
}

void Restarts(HapticPlayer& player) {
  // At whatever moment between two frames it happens.
  for (int i = 0; i < 3; ++i) {
    LastWords(player, false, "the haptic side died and started again");
    player.Run(0.007 * i);
  }
}
void Closes(HapticPlayer& player) {
  LastWords(player, true, "the haptic side closed and started again");
}

void MidWrite(HapticPlayer& player) {
  player.Touch();
  Require(player.Settle(), "ticks are not acknowledged");
  player.publishing = false;
  HapticTick tick = player.NextTick();
  std::vector<std::uint64_t> words(kHapticTickBytes / 8);
  const Encoded shape = Encode(tick, words);
  words.resize(shape.used_bytes / 8);
  const std::uint64_t acks = player.monitor().breaches(kAckForward);
  player.writer().PublishPartly(words, shape, 3);
  player.Die();
  const std::uint64_t frame = player.newest().frame;
  Require(player.Until([&] { return player.newest().frame > frame + 4; }, 3),
          "frames end when a haptic side dies while it writes");
  Require(player.monitor().breaches(kAckForward) == acks, "the unfinished tick is acknowledged");
  player.Open();
  player.Couple();
}

constexpr WorldCase kCases[] = {
    {"world/5.4-1/silent", Silent},
    {"world/7.4-7/restart", Restarts},
    {"world/5.3-5/closes", Closes},
    {"world/4.2-1/mid-write", MidWrite},
};

}  // namespace

std::span<const WorldCase> WorldEndCases() {
  return kCases;
}

}  // namespace rikiseki::protocol::check
