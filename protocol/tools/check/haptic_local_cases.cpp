// SPDX-License-Identifier: MIT
// A haptic side under test, with planes that say what can move, and with bodies that it may move by
// itself: SPEC.md 6.2, 7.2-10 and 7.7.
#include <algorithm>
#include <cmath>
#include <limits>

#include "protocol/tools/check/haptic_cases.h"
#include "protocol/tools/check/haptic_refusal.h"

namespace rikiseki::protocol::check {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kBoulder = 1e6;        // kg: no finger moves it between two frames
constexpr std::size_t kContactsAt = 8;  // contact_count, behind body and generation

/// Makes our surface that of a body which the haptic side may move by itself, with two contacts that
/// it does not reach: a corner, and a rounding.
void SendBoulder(const WorldPlayer& player, WorldFrame& frame) {
  frame.coupling = Coupling::kLocal;
  frame.local_body_count = 1;
  frame.local_substep_ns = 1'000'000;
  LocalBody& boulder = frame.local_bodies[0];
  boulder.body = player.body;
  boulder.generation = player.generation;
  boulder.mass = kBoulder;
  boulder.inertia = {kBoulder, 0, 0, kBoulder, 0, kBoulder};
  boulder.contact_count = 2;
  for (std::uint32_t i = 0; i < boulder.contact_count; ++i) {
    ContactPlane& contact = boulder.contacts[i];
    contact.other_body = 4711;
    contact.point = {0.03, 0, -0.03};
    contact.normal = {0, 0, 1};
    contact.gap = 0.02;
    contact.friction = 0.3;
    contact.radius = 0.005 * i;
  }
  for (std::uint32_t i = 0; i < frame.plane_count; ++i) {
    const Plane& plane = frame.planes[i];
    boulder.position = Sum(plane.point, Scaled(plane.normal, -0.03));
    frame.planes[i].inverse_mass = 1 / kBoulder;
  }
}

void Mobility(WorldPlayer& player) {
  for (const double nonsense : {-0.5, -1.0000001, kNaN, kInfinity}) {
    RefusesFrame(player, [=](WorldFrame& frame) { frame.planes[0].inverse_mass = nonsense; });
  }
}

void RefusesBoulder(WorldPlayer& player, const std::function<void(LocalBody&)>& spoil) {
  player.Press();
  RefusesFrame(player, [&](WorldFrame& frame) {
    SendBoulder(player, frame);
    spoil(frame.local_bodies[0]);
  });
}

void ContactRadius(WorldPlayer& player) {
  for (const double nonsense : {-0.001, kNaN}) {
    RefusesBoulder(player, [=](LocalBody& body) { body.contacts[1].radius = nonsense; });
  }
}

void ContactRanges(WorldPlayer& player) {
  RefusesBoulder(player, [](LocalBody& body) { body.contacts[1].gap = kInfinity; });
  RefusesBoulder(player, [](LocalBody& body) { body.contacts[1].friction = -0.1; });
  RefusesBoulder(player, [](LocalBody& body) { body.contacts[0].other_inverse_mass = -1; });
  RefusesBoulder(player, [](LocalBody& body) { body.contacts[0].normal = {}; });
}

void Mass(WorldPlayer& player) {
  for (const double nonsense : {0.0, -1.0, 1e10, kNaN}) {
    RefusesBoulder(player, [=](LocalBody& body) { body.mass = nonsense; });
  }
}

void Inertia(WorldPlayer& player) {
  RefusesBoulder(player, [](LocalBody& body) { body.inertia = {1, 0, 0, 1, 2, 1}; });
  RefusesBoulder(player, [](LocalBody& body) { body.inertia = {}; });
}

void Contacts(WorldPlayer& player) {
  player.Press();
  Refuses(player, [&](Words& words, Encoded& shape) {
    WorldFrame frame = player.NextFrame();
    SendBoulder(player, frame);
    shape = Encode(frame, words);
    const std::size_t body = RecordBytes("world.frame") +
                             frame.plane_count * RecordBytes("world.frame/plane") +
                             RecordBytes("world.frame/local");
    Poke(words, body + kContactsAt, std::uint32_t{kMaxContactPlanes + 1});
  });
}

void Substep(WorldPlayer& player) {
  player.Press();
  RefusesFrame(player, [&](WorldFrame& frame) {
    SendBoulder(player, frame);
    frame.local_substep_ns = 0;
  });
}

void Twice(WorldPlayer& player) {
  player.Press();
  RefusesFrame(player, [&](WorldFrame& frame) {
    SendBoulder(player, frame);
    frame.local_bodies[1] = frame.local_bodies[0];
    frame.local_body_count = 2;
  });
}

// Whether it moves copies or leaves them alone: the surface of a boulder stays where it is.
void Boulder(WorldPlayer& player) {
  player.Press();
  player.amend = [&](WorldFrame& frame) { SendBoulder(player, frame); };
  const std::uint64_t first = player.frame() + 1;
  Require(player.Until([&] { return player.newest().world_frame > first; }, 1),
          "sound frames with a local body are not displayed");
  const std::size_t from = player.seen().size();
  player.Run(0.3);
  for (std::size_t i = from; i < player.seen().size(); ++i) {
    const SeenTick& seen = player.seen()[i];
    const double gap =
        Dot(Difference(seen.position, player.planes[0].point), player.planes[0].normal) -
        seen.radius;
    Require(gap > -1e-4 || Norm(seen.force) >= kZeroForce,
            "the surface of a local body that hardly moves is lost at tick " +
                std::to_string(seen.tick));
  }
  player.amend = nullptr;
  player.Run(0.1);
  Require(player.Until([&] { return player.Force() >= kZeroForce; }, 2),
          "the surface is lost when its body is not local any more");
}

bool HasChannel(const WorldPlayer& player) {
  const HapticTick& tick = player.newest();
  return std::any_of(tick.channels.begin(), tick.channels.begin() + tick.channel_count,
                     [&](const Channel& channel) {
                       return channel.body == player.body &&
                              channel.generation == player.generation;
                     });
}

// Another body from the first frame on, so that it never was one that may move.
void FixedBody(WorldPlayer& player) {
  player.Press();
  player.planes[0].generation = ++player.generation;
  player.planes[0].inverse_mass = 0;
  const std::uint64_t first = player.frame() + 1;
  bool channel = false;
  bool force = false;
  ImpulseUnits ground = player.newest().ground.impulse;
  player.Until([&] { return player.newest().world_frame > first + 1; }, 1);
  player.Until(
      [&] {
        channel = channel || HasChannel(player);
        force = force || player.Force() >= kZeroForce;
        return false;
      },
      0.3);
  ground = Minus(player.newest().ground.impulse, ground);
  player.planes.clear();
  Require(force, "no force against a body that cannot move");
  Require(!channel, "a channel for a body that cannot move: its share is the ground's");
  Require(Largest(ground) > 0,
          "the ground got nothing of the force against a body that cannot move");
}

constexpr HapticCase kCases[] = {
    {"haptic/7.2-10/fixed-body", FixedBody},
    {"haptic/9.2-3/mobility", Mobility},
    {"haptic/7.7-9/local-body", Boulder},
    {"haptic/9.2-3/contact-radius", ContactRadius},
    {"haptic/9.2-3/contact-ranges", ContactRanges},
    {"haptic/9.2-2/contact-count", Contacts},
    {"haptic/9.2-3/local-mass", Mass},
    {"haptic/6.2-10/inertia", Inertia},
    {"haptic/9.2-3/substep", Substep},
    {"haptic/9.2-3/local-body-twice", Twice},
};

}  // namespace

std::span<const HapticCase> HapticLocalCases() {
  return kCases;
}

}  // namespace rikiseki::protocol::check
