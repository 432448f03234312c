// SPDX-License-Identifier: MIT
// Impulses that are said to act somewhere, on bodies that may be elsewhere by then.
#include <catch2/catch.hpp>
#include <cmath>

#include "tests/world_server/scenes.h"
#include "world_server/physics/bullet_world.h"

namespace rikiseki::world {
namespace {

constexpr double kTick = 1e-3;  // s

PlacedImpulse PushAt(const Vec3& point, const Vec3& impulse, const Vec3& couple = Vec3::Zero()) {
  return {.body = 0,
          .impulse = impulse,
          .angular_impulse = point.cross(impulse) + couple,
          .point = point};
}

BodyState Pushed(const PlacedImpulse& push) {
  BulletWorld world(test::FreeCube(0.05), kTick);
  const Stretch stretch{.length_s = kTick, .pushes = {&push, 1}};
  world.Play({&stretch, 1});
  return world.State(0);
}

}  // namespace

TEST_CASE("a push where the body is acts there, to the bit") {
  const PlacedImpulse push = PushAt({0.03, 0.02, -0.01}, {0.001, -0.01, 0.004});
  const PlacedImpulse within = WithinReach(push, Vec3::Zero(), 0.06);
  CHECK(within.impulse == push.impulse);
  CHECK(within.angular_impulse == push.angular_impulse);
}

TEST_CASE("a push where the body was acts at its nearest place, and a couple stays a couple") {
  const Vec3 impulse(0.002, 0.01, 0.001);
  const Vec3 couple(1e-4, -3e-4, 2e-4);
  const Vec3 centre(0.5, 0.1, 0);
  const double reach = 0.03;
  const PlacedImpulse far = PushAt({-0.3, 0.1, 0.6}, impulse, couple);
  const PlacedImpulse within = WithinReach(far, centre, reach);
  const Vec3 nearest = centre + reach * (*far.point - centre).normalized();
  CHECK((*within.point - nearest).norm() < 1e-15);
  CHECK((within.impulse - impulse).norm() == 0);
  const Vec3 about_centre = within.angular_impulse - centre.cross(impulse);
  CHECK((about_centre - couple - (nearest - centre).cross(impulse)).norm() < 1e-15);
}

// Else a finger that goes on pushing for a period where a light body is no more gives it megajoules.
TEST_CASE("whatever the place of a push, its body gets no more energy than from a push on it") {
  const Vec3 impulse(0.01, 0, 0);
  const double outer = 0.03 * std::sqrt(3);  // m
  const double inertia = 0.05 * 0.06 * 0.06 / 6;
  const double most_j = impulse.squaredNorm() / 2 * (1 / 0.05 + outer * outer / inertia);
  for (const double way : {0.0, 0.05, 1.0, 100.0}) {
    const BodyState state = Pushed(PushAt({0.01, way, -way / 2}, impulse));
    const double energy_j = 0.05 / 2 * state.velocity.squaredNorm() +
                            inertia / 2 * state.angular_velocity.squaredNorm();
    CAPTURE(way, energy_j);
    CHECK(energy_j <= most_j * (1 + 1e-12));
    CHECK((state.velocity - impulse / 0.05).norm() < 1e-12);
  }
}

}  // namespace rikiseki::world
