// SPDX-License-Identifier: MIT
#include "protocol/tools/check/haptic_refusal.h"

#include <cmath>

namespace rikiseki::protocol::check {
namespace {

double ThereShouldBeForce(const WorldPlayer& player, const SeenTick& seen) {
  const Plane& plane = player.planes[0];
  const double gap = Dot(Difference(seen.position, plane.point), plane.normal) - seen.radius;
  return gap < -0.0001 ? -gap : 0;
}

void RefusesThree(WorldPlayer& player, const std::function<void(WorldFrame&)>& amend,
                  const Spoil& spoil, std::int64_t stamp_offset_ns) {
  player.Press();
  const std::uint64_t rejected = player.peer().Counters().rejected;
  const std::uint64_t breaches = player.monitor().breaches(kNeverShown);
  const std::size_t from = player.seen().size();
  for (int i = 0; i < 3; ++i) {
    WorldFrame frame = player.NextFrame();
    if (amend) amend(frame);
    player.PublishSpoilt(frame, spoil, stamp_offset_ns);
    player.Run(0.01);
  }
  player.Run(0.03);
  const std::uint64_t good = player.frame();
  const bool goes_on = player.Until([&] { return player.newest().world_frame > good; }, 1);
  Require(player.monitor().breaches(kNeverShown) == breaches, "a spoilt frame was displayed");
  for (std::size_t i = from; i < player.seen().size(); ++i) {
    const SeenTick& seen = player.seen()[i];
    Require(std::isfinite(Norm(seen.force)), "a force that is not finite");
    Require(Norm(seen.force) >= kZeroForce || ThereShouldBeForce(player, seen) == 0,
            "the surface was lost at tick " + std::to_string(seen.tick) +
                ": the previous frame is to be kept");
  }
  Require(goes_on, "good frames after three spoilt ones are not displayed");
  if (!player.Until([&] { return player.peer().Counters().rejected > rejected; }, 2)) {
    Fail("the header's `rejected` does not count them");
  }
}

}  // namespace

void Refuses(WorldPlayer& player, const Spoil& spoil, std::int64_t stamp_offset_ns) {
  RefusesThree(player, nullptr, spoil, stamp_offset_ns);
}

void RefusesFrame(WorldPlayer& player, const std::function<void(WorldFrame&)>& amend) {
  RefusesThree(
      player, amend, [](Words&, Encoded&) {}, 0);
}

}  // namespace rikiseki::protocol::check
