// SPDX-License-Identifier: MIT
// A world under test that says what can move, and that sends bodies which the haptic side may move by
// itself: SPEC.md 6.2 and 7.7.
#include <algorithm>
#include <cmath>

#include "protocol/tools/check/world_cases.h"

namespace rikiseki::protocol::check {
namespace {

constexpr double kStill = 1e-4;      // m/s, rad/s: slower is at rest
constexpr double kSamePlace = 1e-5;  // m, of a body at rest, in two streams
constexpr double kRestGap = 1e-4;    // m: 0.2 N at 2 kN/m

void SaysMobility(HapticPlayer& player) {
  player.Touch();
  const double inverse_mass = player.touched().inverse_mass;
  const auto body = player.BodyOf(player.touched().body);
  if (!body) Unimplemented("no stream world.bodies that tells what can move");
  Require(body->mass == 0 || inverse_mass != 0,
          "a body of " + Num(body->mass) + " kg is said to be fixed");
  if (body->mass == 0 && inverse_mass != 0) {
    NotStrict("the mobility of a body that cannot move is " +
              (inverse_mass == kMobilityNotSaid ? "not said" : Num(inverse_mass) + " 1/kg"));
  }
  if (inverse_mass == kMobilityNotSaid) Inform("the mobility of a body that can move is not said");
}

/// The newest frame, with the box among its local bodies and at rest.
WorldFrame RestingFrame(HapticPlayer& player) {
  player.Touch();
  if (player.newest().coupling != Coupling::kLocal) Unimplemented("the coupling is not `local`");
  const auto local = [&]() -> const LocalBody* {
    const WorldFrame& frame = player.newest();
    const auto end = frame.local_bodies.begin() + frame.local_body_count;
    const auto body = std::find_if(frame.local_bodies.begin(), end, [&](const LocalBody& one) {
      return one.body == player.touched().body;
    });
    return body == end ? nullptr : &*body;
  };
  if (!player.Until([&] { return local() != nullptr; }, 1)) {
    Inform("the box is not sent as a local body");
  }
  player.Settle();
  const bool rests = player.Until(
      [&] {
        const LocalBody* const body = local();
        return body != nullptr && Norm(body->velocity) < kStill &&
               Norm(body->angular_velocity) < kStill;
      },
      2);
  if (!rests) Inform("the box does not come to rest");
  return player.newest();
}

void LocalState(HapticPlayer& player) {
  const WorldFrame frame = RestingFrame(player);
  for (std::uint32_t i = 0; i < frame.local_body_count; ++i) {
    const LocalBody& local = frame.local_bodies[i];
    const std::string who = "local body " + std::to_string(local.body);
    const auto body = player.BodyOf(local.body);
    if (!body) Inform(who + " is not in world.bodies");
    Require(body->generation == local.generation, who + " has another generation in world.bodies");
    Require(std::abs(body->mass - local.mass) <= 1e-9 * local.mass,
            who + " weighs " + Num(local.mass) + " kg, " + Num(body->mass) + " in world.bodies");
    if (Norm(local.velocity) >= kStill || Norm(body->velocity) >= kStill) continue;
    const double distance = Norm(Difference(body->position, local.position));
    Require(distance <= kSamePlace,
            who + ", at rest, is " + Num(distance) + " m from where world.bodies has it");
  }
}

void RestingGaps(HapticPlayer& player) {
  const WorldFrame frame = RestingFrame(player);
  std::uint32_t looks = 0;
  for (std::uint32_t i = 0; i < frame.local_body_count; ++i) {
    const LocalBody& local = frame.local_bodies[i];
    if (Norm(local.velocity) >= kStill || Norm(local.angular_velocity) >= kStill) continue;
    for (std::uint32_t c = 0; c < local.contact_count; ++c) {
      const ContactPlane& contact = local.contacts[c];
      if (!(Dot(contact.impulse, contact.normal) > 0)) continue;
      ++looks;
      Require(std::abs(contact.gap) <= kRestGap, "body " + std::to_string(local.body) +
                                                     " rests on a contact with a gap of " +
                                                     Num(contact.gap) + " m");
    }
  }
  if (looks == 0) Inform("no contact presses");
}

void ContactsOnce(HapticPlayer& player) {
  const WorldFrame frame = RestingFrame(player);
  const auto names = [](const LocalBody& a, const LocalBody& b) {
    return std::any_of(
        a.contacts.begin(), a.contacts.begin() + a.contact_count, [&](const ContactPlane& contact) {
          return contact.other_body == b.body && contact.other_generation == b.generation;
        });
  };
  for (std::uint32_t i = 0; i < frame.local_body_count; ++i) {
    const LocalBody& a = frame.local_bodies[i];
    Require(!names(a, a), "body " + std::to_string(a.body) + " touches itself");
    for (std::uint32_t j = 0; j < i; ++j) {
      const LocalBody& b = frame.local_bodies[j];
      Require(!names(a, b) || !names(b, a), "the contact of bodies " + std::to_string(a.body) +
                                                " and " + std::to_string(b.body) +
                                                " stands with both");
    }
  }
}

constexpr WorldCase kCases[] = {
    {"world/6.2-13/mobility", SaysMobility},
    {"world/7.7-6/local-state", LocalState},
    {"world/6.2-14/resting-gaps", RestingGaps},
    {"world/6.2-15/contacts-once", ContactsOnce},
};

}  // namespace

std::span<const WorldCase> WorldLocalCases() {
  return kCases;
}

}  // namespace rikiseki::protocol::check
