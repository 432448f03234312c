// SPDX-License-Identifier: MIT
#include "haptic_server/render/friction.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <random>

#include "haptic_server/render/surface_force.h"

namespace rikiseki::haptic {
namespace {

constexpr double kStiffness = 1000;
constexpr double kPeriod = 1e-3;

// A finger on a floor whose normal is z, pressed on with `normal_force`.
struct Floor {
  Vec3 Slip(const Vec3& slip) {
    contact.slip = slip;
    const Vec3 force = friction.Force(contact, kPeriod);
    friction.EndTick();
    return force;
  }
  Friction friction{kStiffness};
  FrictionContact contact{.body = 1,
                          .normal = Vec3::UnitZ(),
                          .normal_force = 5,
                          .static_friction = 0.4,
                          .dynamic_friction = 0.3,
                          .damping = 0};
};

TEST_CASE("a finger that sticks is held by a spring from where it stuck") {
  Floor floor;
  REQUIRE(floor.Slip(Vec3(1, 2, 3)).isZero(0));  // the first touch
  Vec3 way = Vec3::Zero();
  for (int k = 0; k < 100; ++k) {
    const Vec3 slip(1e-5 * std::cos(0.1 * k), 1e-5 * std::sin(0.2 * k), 1e-4);
    way += Vec3(slip.x(), slip.y(), 0);
    REQUIRE((floor.Slip(slip) + kStiffness * way).norm() < 1e-12);
  }
  REQUIRE(floor.friction.stored() == Approx(kStiffness / 2 * way.squaredNorm()));
  REQUIRE(floor.Slip(-way).norm() < 1e-12);
}

TEST_CASE("beyond mu_s N it slides at mu_d N, against the relative motion") {
  Floor floor;
  floor.Slip(Vec3::Zero());
  const Vec3 direction(0.6, -0.8, 0);
  double largest = 0;
  Vec3 force = Vec3::Zero();
  for (int k = 0; k < 400; ++k) {
    force = floor.Slip(2e-5 * direction);
    largest = std::max(largest, force.norm());
    if (k > 110) REQUIRE((force + 0.3 * 5 * direction).norm() < 1e-12);
  }
  REQUIRE(largest == Approx(0.4 * 5).epsilon(0.02));
  // It turns with the motion, and sticks when that stops and turns back.
  const Vec3 other(0.8, 0.6, 0);
  for (int k = 0; k < 2000; ++k) force = floor.Slip(2e-5 * other);
  REQUIRE((force + 0.3 * 5 * other).norm() < 1e-9);
  REQUIRE((floor.Slip(Vec3::Zero()) - force).norm() < 1e-12);
  REQUIRE((floor.Slip(-1e-5 * other) - force - kStiffness * 1e-5 * other).norm() < 1e-9);
  // From a stick, the static limit holds again.
  largest = 0;
  for (int k = 0; k < 400; ++k) largest = std::max(largest, floor.Slip(-2e-5 * other).norm());
  REQUIRE(largest == Approx(0.4 * 5).epsilon(0.02));
}

TEST_CASE("friction fades with the normal force, and a body that was let go is forgotten") {
  Floor floor;
  floor.Slip(Vec3::Zero());
  for (int k = 0; k < 300; ++k) floor.Slip(Vec3(2e-5, 0, 0));
  floor.contact.normal_force = 1;
  REQUIRE(floor.Slip(Vec3::Zero()).norm() == Approx(0.3));
  floor.contact.normal_force = 0;
  REQUIRE(floor.Slip(Vec3::Zero()).isZero(0));
  floor.contact.normal_force = 5;
  REQUIRE(floor.Slip(Vec3(1e-4, 0, 0)).norm() == Approx(0.1));
  floor.friction.EndTick();  // a tick without it
  REQUIRE_FALSE(floor.friction.holds());
  REQUIRE(floor.Slip(Vec3(1e-4, 0, 0)).isZero(0));
}

TEST_CASE("the cone holds whatever comes, and the static coefficient is at least the dynamic one") {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> any(-1, 1);
  Floor floor;
  floor.contact.damping = 2;
  for (int k = 0; k < 100'000; ++k) {
    if (random() % 10 == 0) {
      floor.contact.normal_force = random() % 4 == 0 ? 0 : 8 * std::abs(any(random));
      floor.contact.static_friction = std::abs(any(random));
      floor.contact.dynamic_friction = std::abs(any(random));
      floor.contact.normal = Vec3(any(random), any(random), any(random)).normalized();
    }
    const double scale = std::pow(10, 3 * any(random) - 5);
    const Vec3 force = floor.Slip(scale * Vec3(any(random), any(random), any(random)));
    const double mu = std::max(floor.contact.static_friction, floor.contact.dynamic_friction);
    REQUIRE(force.allFinite());
    REQUIRE(force.norm() <= mu * floor.contact.normal_force * (1 + 1e-12));
    REQUIRE(std::abs(force.dot(floor.contact.normal)) < 1e-9);
  }
}

TEST_CASE("no energy is made in stick-slip, however the finger strokes and presses") {
  // Damped by more than kT/2 the held spring leaks nothing, for motion that the ticks resolve.
  Floor floor;
  floor.contact.damping = kStiffness * kPeriod;
  floor.Slip(Vec3::Zero());
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> phase(0, 2 * M_PI);
  const double p[] = {phase(random), phase(random), phase(random), phase(random), phase(random)};
  const auto finger = [&](double t) {
    return Vec3(
        0.004 * std::sin(2 * M_PI * 3 * t + p[0]) + 0.001 * std::sin(2 * M_PI * 11 * t + p[1]),
        0.003 * std::sin(2 * M_PI * 2 * t + p[2]), 0);
  };
  double energy = 0;
  double dissipated = 0;
  Vec3 force = Vec3::Zero();
  int slid = 0;
  int stuck = 0;
  for (int k = 1; k < 20'000; ++k) {
    const double t = k * kPeriod;
    const Vec3 slip = finger(t) - finger(t - kPeriod);
    energy += force.dot(slip);
    REQUIRE(energy + floor.friction.stored() <= 1e-6);
    floor.contact.normal_force = 5 + 4.5 * std::sin(2 * M_PI * 1.3 * t + p[3]);
    force = floor.Slip(slip);
    const bool at_limit = force.norm() >= 0.2999 * floor.contact.normal_force;
    (at_limit ? slid : stuck) += 1;
    dissipated = -energy;
  }
  REQUIRE(slid > 2000);
  REQUIRE(stuck > 2000);
  REQUIRE(dissipated > 0.1);
}

// A finger 2.5 mm deep in a floor at z = 0, 5 N at 2 kN/m, that moves along x.
struct Rendered {
  explicit Rendered(const Surface& floor) : surface(floor), force(Settings(), kPeriod) {
    surface.body = 3;
    surface.plane = {Vec3::Zero(), Vec3::UnitZ()};
  }
  static RenderSettings Settings() {
    RenderSettings settings;
    settings.damping_ns_per_m = 0;
    return settings;
  }
  BodyShare At(const Vec3& finger) {
    const ContactSolution contact = SolveContact(finger, 0.01, std::span(&surface.plane, 1));
    const auto shares = force.Update(std::span(&surface, 1), contact, 0.01, 1);
    REQUIRE(shares.size() == 1);
    return shares[0];
  }
  Surface surface;
  SurfaceForce force;
};

TEST_CASE("the body's share holds its friction, from its own velocity, not the plane's slope") {
  Surface floor;
  floor.dynamic_friction = 0.3;
  floor.static_friction = 0.4;
  SECTION("the finger strokes a floor at rest") {
    Rendered rendered(floor);
    BodyShare share;
    for (int k = 0; k < 300; ++k) share = rendered.At(Vec3(1e-4 * k, 0, 0.0075));
    REQUIRE((share.force - Vec3(-1.5, 0, 5)).norm() < 1e-9);
    REQUIRE((share.point - Vec3(0.0299, 0, 0)).norm() < 1e-9);
  }
  SECTION("a belt drags a finger at rest along") {
    floor.velocity = Vec3(0.1, 0, 0);
    Rendered rendered(floor);
    BodyShare share;
    for (int k = 0; k < 300; ++k) share = rendered.At(Vec3(0, 0, 0.0075));
    REQUIRE((share.force - Vec3(1.5, 0, 5)).norm() < 1e-9);
  }
  SECTION("a finger that goes with the belt feels nothing of it") {
    floor.velocity = Vec3(0.1, 0, 0);
    Rendered rendered(floor);
    BodyShare share;
    for (int k = 0; k < 300; ++k) share = rendered.At(Vec3(1e-4 * k, 0, 0.0075));
    REQUIRE((share.force - Vec3(0, 0, 5)).norm() < 1e-9);
  }
  SECTION("a displayed point that slides under the finger is no motion of the body") {
    Rendered rendered(floor);
    BodyShare share;
    for (int k = 0; k < 300; ++k) {
      rendered.surface.plane.point.x() = 1e-3 * k;
      share = rendered.At(Vec3(0, 0, 0.0075));
    }
    REQUIRE((share.force - Vec3(0, 0, 5)).norm() < 1e-9);
  }
  SECTION("free for a tick, it starts anew") {
    Rendered rendered(floor);
    for (int k = 0; k < 10; ++k) rendered.At(Vec3(1e-4 * k, 0, 0.0075));
    rendered.force.Reset();
    REQUIRE((rendered.At(Vec3(1, 0, 0.0075)).force - Vec3(0, 0, 5)).norm() < 1e-9);
    REQUIRE((rendered.At(Vec3(1.0001, 0, 0.0075)).force - Vec3(-0.1, 0, 5)).norm() < 1e-9);
  }
}

TEST_CASE("without coefficients nothing changes, to the bit") {
  Surface moving;
  moving.velocity = Vec3(3, 1, -2);
  Rendered plain(Surface{});
  Rendered with(moving);
  std::mt19937_64 random(9);
  std::uniform_real_distribution<double> any(-0.01, 0.01);
  for (int k = 0; k < 1000; ++k) {
    const Vec3 finger(any(random), any(random), any(random) - 0.001);
    const BodyShare a = plain.At(finger);
    const BodyShare b = with.At(finger);
    REQUIRE(a.force == b.force);
    REQUIRE(a.point == b.point);
  }
}

}  // namespace
}  // namespace rikiseki::haptic
