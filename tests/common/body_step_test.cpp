// SPDX-License-Identifier: MIT
#include "common/body_step.h"

#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <numeric>
#include <random>
#include <vector>

namespace rikiseki {
namespace {

constexpr double kStep = 1e-3;
constexpr double kGravity = 9.81;
constexpr double kMu = 0.3;

StepBody Cube(double edge, double mass_kg, double gravity = kGravity) {
  StepBody body;
  body.inertia = BodyInertia::Of(mass_kg, Mat3::Identity() * (mass_kg * edge * edge / 6));
  body.acceleration = {0, 0, -gravity};
  return body;
}

// The four lower corners of a cube, over a floor that its centre is edge / 2 above.
std::vector<StepContact> OnFloor(double edge, double friction) {
  std::vector<StepContact> contacts;
  for (const double x : {-edge / 2, edge / 2}) {
    for (const double y : {-edge / 2, edge / 2}) {
      StepContact& contact = contacts.emplace_back();
      contact.p_B = {x, y, -edge / 2};
      contact.point = {0, 0, -edge / 2};
      contact.friction = friction;
    }
  }
  return contacts;
}

double TotalNormal(const std::vector<StepContact>& contacts) {
  return std::accumulate(
      contacts.begin(), contacts.end(), 0.0,
      [](double sum, const StepContact& contact) { return sum + contact.normal_impulse; });
}

// One step with an impulse through a place of the body, and what must hold in every step: all that
// the contacts did stays within the cone, their velocities part or stand.
void Step(StepBody& body, std::vector<StepContact>& contacts, const Vec3& impulse,
          const Vec3& place_B, double friction) {
  const Vec3 arm = body.state.pose.orientation * place_B;
  ApplyImpulse(body.inertia, impulse, arm.cross(impulse), body.state);
  const Vec3 before = body.state.velocity + kStep * body.acceleration;
  StepBodies(std::span(&body, 1), contacts, kStep, PositionRule::kSecondOrder);
  const Vec3 given = body.inertia.mass_kg * (body.state.velocity - before);
  const double normal = TotalNormal(contacts);
  REQUIRE(given.z() == Approx(normal).epsilon(1e-9).margin(1e-15));
  REQUIRE(std::hypot(given.x(), given.y()) <= friction * normal * (1 + 1e-9) + 1e-15);
}

Vec3 AngularMomentum(const StepBody& body) {
  const Mat3 axes = body.state.pose.orientation.toRotationMatrix();
  return axes * body.inertia.inertia_B * axes.transpose() * body.state.angular_velocity +
         body.inertia.mass_kg * body.state.pose.position.cross(body.state.velocity);
}

}  // namespace

TEST_CASE("free fall and the flight after a kick are exact by the second-order rule") {
  StepBody body = Cube(0.06, 0.4);
  ApplyImpulse(body.inertia, {0.2, -0.1, 0.9}, Vec3(1e-4, 0, 2e-4), body.state);
  const Vec3 v0 = body.state.velocity;
  const Vec3 spin = body.state.angular_velocity;
  for (int i = 1; i <= 1000; ++i) {
    StepBodies(std::span(&body, 1), {}, kStep, PositionRule::kSecondOrder);
    const double t = i * kStep;
    const Vec3 exact = t * v0 - Vec3(0, 0, kGravity / 2 * t * t);
    REQUIRE((body.state.pose.position - exact).norm() < 1e-12);
  }
  CHECK((body.state.velocity - v0 + Vec3(0, 0, kGravity)).norm() < 1e-12);
  const Quat exact(Eigen::AngleAxisd(spin.norm(), spin.normalized()));
  CHECK(body.state.pose.orientation.angularDistance(exact) < 1e-12);
}

TEST_CASE("the semi-implicit rule falls g t h / 2 further") {
  StepBody body = Cube(0.06, 0.4);
  for (int i = 0; i < 1000; ++i) {
    StepBodies(std::span(&body, 1), {}, kStep, PositionRule::kSemiImplicit);
  }
  CHECK(body.state.pose.position.z() == Approx(-kGravity / 2 * (1 + kStep)).epsilon(1e-12));
}

TEST_CASE("angular acceleration by what does not answer the push turns the body") {
  StepBody body = Cube(0.06, 0.4, 0);
  body.angular_acceleration = {0, 0, 2};
  for (int i = 0; i < 500; ++i) {
    StepBodies(std::span(&body, 1), {}, kStep, PositionRule::kSecondOrder);
  }
  CHECK((body.state.angular_velocity - Vec3(0, 0, 1)).norm() < 1e-12);
}

TEST_CASE("a cube slides v^2 / (2 mu g), in any direction, and stands") {
  // The step in which it stops is not moved at all: short by mu g h^2 / 2 at most.
  const double short_by = kMu * kGravity * kStep * kStep / 2;
  for (const double degrees : {0.0, 17.0, 45.0, 200.0}) {
    for (const double speed : {1.0, 0.7503, 0.1}) {
      StepBody body = Cube(0.06, 0.5);
      std::vector<StepContact> contacts = OnFloor(0.06, kMu);
      const double angle = degrees * M_PI / 180;
      const Vec3 along(std::cos(angle), std::sin(angle), 0);
      body.state.velocity = speed * along;
      for (int i = 0; i < 500; ++i) Step(body, contacts, Vec3::Zero(), Vec3::Zero(), kMu);
      CHECK(body.state.velocity.norm() < 1e-9);
      const double distance = speed * speed / (2 * kMu * kGravity);
      CHECK((body.state.pose.position - distance * along).norm() < short_by + 1e-7 * distance);
      CHECK(body.state.pose.orientation.angularDistance(Quat::Identity()) < 1e-6);
    }
  }
}

TEST_CASE("a push below stiction does not creep in 5 s") {
  for (const double force : {1.0, 2.5}) {
    for (const Vec3& place : {Vec3(0, 0, 0), Vec3(-0.03, 0, 0.01), Vec3(-0.03, 0.004, 0)}) {
      StepBody body = Cube(0.06, 1);
      std::vector<StepContact> contacts = OnFloor(0.06, kMu);
      for (int i = 0; i < 5000; ++i) {
        Step(body, contacts, Vec3(force * kStep, 0, 0), place, kMu);
      }
      CAPTURE(force, place.transpose());
      CHECK(body.state.pose.position.norm() < 1e-6);
      CHECK(body.state.pose.orientation.angularDistance(Quat::Identity()) < 1e-5);
    }
  }
}

TEST_CASE("a push beyond stiction accelerates by (F - mu M g) / M") {
  StepBody body = Cube(0.06, 1);
  std::vector<StepContact> contacts = OnFloor(0.06, kMu);
  for (int i = 0; i < 200; ++i) Step(body, contacts, Vec3(4 * kStep, 0, 0), Vec3::Zero(), kMu);
  const double speed = (4 - kMu * kGravity) * 0.2;
  CHECK(body.state.velocity.x() == Approx(speed).epsilon(1e-6));
}

TEST_CASE("a pressed block of 5 g stands: the floor carries weight and push") {
  for (const Vec3& place : {Vec3(0, 0, 0.03), Vec3(0.01, -0.015, 0.03)}) {
    StepBody body = Cube(0.06, 0.005);
    std::vector<StepContact> contacts = OnFloor(0.06, kMu);
    for (int i = 0; i < 1000; ++i) {
      Step(body, contacts, Vec3(0, 0, -5 * kStep), place, kMu);
      REQUIRE(TotalNormal(contacts) == Approx((0.005 * kGravity + 5) * kStep).epsilon(1e-6));
    }
    CHECK(body.state.velocity.norm() < 1e-8);
    CHECK(body.state.pose.position.norm() < 1e-7);
  }
}

TEST_CASE("where the solver starts does not decide where it ends") {
  std::array<Vec3, 2> velocity;
  for (const double warm : {0.0, 0.05}) {
    StepBody body = Cube(0.06, 0.5);
    body.state.velocity = {0.3, 0.1, -0.2};
    std::vector<StepContact> contacts = OnFloor(0.06, kMu);
    for (StepContact& contact : contacts) contact.normal_impulse = warm;
    StepBodies(std::span(&body, 1), contacts, kStep, PositionRule::kSecondOrder);
    velocity[warm > 0 ? 1 : 0] = body.state.velocity;
    CHECK(TotalNormal(contacts) == Approx(0.5 * (0.2 + kGravity * kStep)).epsilon(1e-6));
  }
  CHECK((velocity[0] - velocity[1]).norm() < 1e-6);
}

TEST_CASE("two bodies that collide keep their momentum and do not go on approaching") {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> any(-1, 1);
  const auto vector = [&] { return Vec3(any(random), any(random), any(random)); };
  for (int trial = 0; trial < 200; ++trial) {
    std::array<StepBody, 2> bodies;
    for (StepBody& body : bodies) {
      const Mat3 axes =
          Quat(any(random), any(random), any(random), 1.5).normalized().toRotationMatrix();
      const double mass = std::pow(10, any(random));
      body.inertia = BodyInertia::Of(
          mass, axes * (mass * Vec3(4e-4, 5e-4, 7e-4)).asDiagonal() * axes.transpose());
      body.state.pose.orientation = Quat(1.2, any(random), any(random), any(random)).normalized();
      body.state.velocity = vector();
      body.state.angular_velocity = 5 * vector();
    }
    bodies[0].state.pose.position = {0, 0, 0.05};
    const Vec3 normal = (Vec3::UnitZ() + 0.3 * vector()).normalized();
    const Vec3 point = 0.02 * vector();
    const Pose back_0 = bodies[0].state.pose.Inverse();
    const Pose back_1 = bodies[1].state.pose.Inverse();
    std::vector<StepContact> contacts(1);
    contacts[0].body = 0;
    contacts[0].other = 1;
    contacts[0].p_B = back_0 * point;
    contacts[0].point = back_1 * point;
    contacts[0].normal = back_1.orientation * normal;
    contacts[0].friction = trial % 2 == 0 ? 0.4 : 0;

    const auto momentum = [&] {
      return Vec3(bodies[0].inertia.mass_kg * bodies[0].state.velocity +
                  bodies[1].inertia.mass_kg * bodies[1].state.velocity);
    };
    const auto angular = [&] {
      return Vec3(AngularMomentum(bodies[0]) + AngularMomentum(bodies[1]));
    };
    const auto energy = [&] {
      double sum = 0;
      for (const StepBody& body : bodies) {
        const Vec3 spin = body.state.pose.orientation.conjugate() * body.state.angular_velocity;
        sum += body.inertia.mass_kg * body.state.velocity.squaredNorm() +
               spin.dot(body.inertia.inertia_B * spin);
      }
      return sum / 2;
    };
    const auto approach = [&] {
      return normal.dot(bodies[0].state.VelocityAt(point) - bodies[1].state.VelocityAt(point));
    };
    const Vec3 momentum_before = momentum();
    const Vec3 angular_before = angular();
    const double energy_before = energy();
    const Vec3 velocity_before = bodies[0].state.velocity;
    const double approach_before = approach();
    SolveVelocities(bodies, contacts, {}, kStep);
    REQUIRE((momentum() - momentum_before).norm() < 1e-14 * (1 + momentum_before.norm()));
    REQUIRE((angular() - angular_before).norm() < 1e-14 * (1 + angular_before.norm()));
    const Vec3 given = bodies[0].inertia.mass_kg * (bodies[0].state.velocity - velocity_before);
    REQUIRE(given.dot(normal) == Approx(contacts[0].normal_impulse).epsilon(1e-9).margin(1e-15));
    REQUIRE((given - given.dot(normal) * normal).norm() <=
            contacts[0].friction * contacts[0].normal_impulse * (1 + 1e-9) + 1e-15);
    REQUIRE(energy() <= energy_before * (1 + 1e-12));
    REQUIRE(approach() > -1e-6);
    if (approach_before > 0) REQUIRE(contacts[0].normal_impulse == 0);
    if (approach_before < -1e-6) REQUIRE(contacts[0].normal_impulse > 0);
  }
}

TEST_CASE("a body that is hit goes on with its new velocity at once, and the two stay together") {
  std::array<StepBody, 2> bodies = {Cube(0.06, 0.5, 0), Cube(0.06, 1.5, 0)};
  bodies[0].state.velocity = {1, 0, 0};
  bodies[1].state.pose.position = {0.06, 0, 0};
  std::vector<StepContact> contacts(1);
  contacts[0].other = 1;
  contacts[0].p_B = {0.03, 0, 0};
  contacts[0].point = {-0.03, 0, 0};
  contacts[0].normal = {-1, 0, 0};
  for (int i = 1; i <= 100; ++i) {
    StepBodies(bodies, contacts, kStep, PositionRule::kSecondOrder);
    REQUIRE(bodies[0].state.pose.position.x() == Approx(0.25 * kStep * i).epsilon(1e-9));
    REQUIRE(bodies[1].state.pose.position.x() == Approx(0.06 + 0.25 * kStep * i).epsilon(1e-9));
  }
}

TEST_CASE("a gap closes within the step and no further") {
  StepBody body = Cube(0.06, 0.5, 0);
  std::vector<StepContact> contacts = OnFloor(0.06, 0);
  body.state.pose.position.z() = 2e-4;
  body.state.velocity.z() = -0.5;
  StepBodies(std::span(&body, 1), contacts, kStep, PositionRule::kSecondOrder);
  CHECK(body.state.velocity.z() == Approx(-0.2).epsilon(1e-9));
  CHECK(std::abs(body.state.pose.position.z()) < 1e-12);
  StepBodies(std::span(&body, 1), contacts, kStep, PositionRule::kSecondOrder);
  CHECK(std::abs(body.state.velocity.z()) < 1e-9);
  CHECK(std::abs(body.state.pose.position.z()) < 1e-12);
}

TEST_CASE("a shallow penetration opens by a fifth per step") {
  StepBody body = Cube(0.06, 0.5, 0);
  std::vector<StepContact> contacts = OnFloor(0.06, 0);
  body.state.pose.position.z() = -5e-5;
  StepBodies(std::span(&body, 1), contacts, kStep, PositionRule::kSecondOrder);
  CHECK(body.state.pose.position.z() == Approx(-4e-5).epsilon(1e-9));
}

TEST_CASE("a deep penetration is mended without giving velocity") {
  StepBody body = Cube(0.06, 0.5, 0);
  std::vector<StepContact> contacts = OnFloor(0.06, kMu);
  double depth = 1e-3;
  body.state.pose.position.z() = -depth;
  while (depth > kDeepPenetration) {
    StepBodies(std::span(&body, 1), contacts, kStep, PositionRule::kSecondOrder);
    depth *= 1 - kPenetrationRecovery;
    REQUIRE(body.state.pose.position.z() == Approx(-depth).epsilon(1e-9));
    REQUIRE(body.state.velocity.norm() == 0);
  }
}

TEST_CASE("two planes at an angle both get their part of the mending") {
  StepBody body = Cube(0.06, 0.5, 0);
  std::vector<StepContact> contacts(2);
  contacts[0].normal = Vec3(0.6, 0, 0.8);
  contacts[0].point = 1e-3 * contacts[0].normal;
  contacts[1].normal = Vec3(-0.6, 0, 0.8);
  contacts[1].point = 1e-3 * contacts[1].normal;
  StepBodies(std::span(&body, 1), contacts, kStep, PositionRule::kSecondOrder);
  for (const StepContact& contact : contacts) {
    const double mended = body.state.pose.position.dot(contact.normal);
    CHECK(mended > 1e-4);
    CHECK(mended < 4e-4);
  }
  CHECK(body.state.velocity.norm() == 0);
}

TEST_CASE("a ball that is thrown along the floor ends up rolling at 5/7 of its speed") {
  const double radius = 0.03;
  StepBody body = Cube(0.06, 0.2);
  body.inertia = BodyInertia::Of(0.2, Mat3::Identity() * (0.4 * 0.2 * radius * radius));
  body.state.velocity = {0.6, 0.8, 0};
  std::vector<StepContact> contacts(1);
  contacts[0].radius = radius;
  contacts[0].point = {0, 0, -radius};
  contacts[0].friction = kMu;
  for (int i = 0; i < 500; ++i) {
    StepBodies(std::span(&body, 1), contacts, kStep, PositionRule::kSecondOrder);
  }
  const Vec3 rolling = 5.0 / 7 * Vec3(0.6, 0.8, 0);
  CHECK((body.state.velocity - rolling).norm() < 1e-8);
  CHECK((body.state.angular_velocity - Vec3::UnitZ().cross(rolling) / radius).norm() < 1e-6);
  CHECK(std::abs(body.state.pose.position.z()) < 1e-9);
  // v0^2 / (2 mu g) (12/49) of sliding, rolling from then on: t1 = 2 v0 / (7 mu g).
  const double t1 = 2 / (7 * kMu * kGravity);
  const double distance = t1 * (1 + 5.0 / 7) / 2 + (0.5 - t1) * 5 / 7;
  CHECK(body.state.pose.position.norm() == Approx(distance).margin(2e-6));
}

TEST_CASE("moving surroundings carry the body along, and carry their plane") {
  StepBody body = Cube(0.06, 0.5);
  std::vector<StepContact> contacts = OnFloor(0.06, kMu);
  for (StepContact& contact : contacts) contact.velocity = {0.1, 0, 0.05};
  for (int i = 0; i < 500; ++i) {
    StepBodies(std::span(&body, 1), contacts, kStep, PositionRule::kSecondOrder);
  }
  CHECK((body.state.velocity - Vec3(0.1, 0, 0.05)).norm() < 1e-8);
  CHECK(contacts[0].point.z() == Approx(-0.03 + 0.025).epsilon(1e-9));
  CHECK(body.state.pose.position.z() == Approx(0.025).margin(1e-6));
}

TEST_CASE("a spring on a free body is backward Euler's closed form, for any mass") {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> any(0, 1);
  for (const double mass : {1e-5, 1e-3, 0.5, 100.0}) {
    for (const double stiffness : {10.0, 2e3, 1e4}) {
      for (const double damping : {0.0, 2.0, 50.0}) {
        StepBody body = Cube(0.06, mass, 0);
        const double speed = any(random) - 0.2;
        const double depth = 0.005 * any(random);
        const Vec3 normal = Vec3(any(random), any(random), any(random) + 0.1).normalized();
        body.state.velocity = speed * normal;
        StepSpring spring{.point_W = 0.02 * normal,
                          .normal = normal,
                          .base_ns = kStep * stiffness * depth,
                          .per_speed_kg = kStep * (kStep * stiffness + damping)};
        SolveVelocities(std::span(&body, 1), {}, std::span(&spring, 1), kStep);
        // The body at x = -depth behind the finger at C = 0 leaves along the normal: x + T v.
        const double force =
            std::max(0.0, (stiffness * (depth + kStep * speed) + damping * speed) /
                              (1 + stiffness * kStep * kStep / mass + damping * kStep / mass));
        CAPTURE(mass, stiffness, damping, speed, depth);
        CHECK(spring.impulse_ns == Approx(force * kStep).epsilon(1e-12).margin(1e-18));
        const Vec3 gained = mass * (body.state.velocity - speed * normal);
        CHECK((gained + spring.impulse_ns * normal).norm() <
              1e-12 * (spring.impulse_ns + mass * std::abs(speed)));
      }
    }
  }
}

TEST_CASE("a spring beside the centre feels the effective mass there") {
  StepBody body = Cube(0.06, 1e-3, 0);
  body.inertia = BodyInertia::Of(1e-3, Vec3(4e-7, 5e-7, 7e-7).asDiagonal());
  body.state.pose.orientation = Quat(0.9, 0.1, -0.3, 0.2).normalized();
  const Vec3 normal = Vec3(0.3, -0.2, 0.9).normalized();
  const Vec3 point(0.02, 0.01, 0.03);
  const double yield = InverseEffectiveMass(body.inertia, body.state.pose, point, normal);
  StepSpring spring{.point_W = point, .normal = normal, .base_ns = 1e-2, .per_speed_kg = 0.05};
  SolveVelocities(std::span(&body, 1), {}, std::span(&spring, 1), kStep);
  CHECK(spring.impulse_ns == Approx(1e-2 / (1 + 0.05 * yield)).epsilon(1e-12));
  const double speed = body.state.VelocityAt(point).dot(normal);
  CHECK(speed == Approx(-yield * spring.impulse_ns).epsilon(1e-12));
}

// From a cold start the sweeps approach this as 1 - (1 - M/(k T^2))^50; the contacts start where they
// were, so that the next ticks do the rest.
TEST_CASE("a spring that presses a light body on the floor gives its full force") {
  const double stiffness = 1e4;
  const double depth = 1e-3;
  for (const double mass : {1e-5, 1e-4, 1e-3}) {
    StepBody body = Cube(0.06, mass);
    std::vector<StepContact> contacts = OnFloor(0.06, kMu);
    StepSpring spring{.point_W = {0, 0, 0.03},
                      .base_ns = kStep * stiffness * depth,
                      .per_speed_kg = kStep * kStep * stiffness};
    const int ticks = mass < 1e-4 ? 100 : 10;
    for (int i = 0; i < ticks; ++i) {
      body.state.velocity.setZero();
      body.state.angular_velocity.setZero();
      SolveVelocities(std::span(&body, 1), contacts, std::span(&spring, 1), kStep);
      CHECK(spring.impulse_ns < kStep * stiffness * depth * (1 + 1e-6));
    }
    CAPTURE(mass);
    CHECK(spring.impulse_ns == Approx(kStep * stiffness * depth).epsilon(1e-2));
    CHECK(TotalNormal(contacts) ==
          Approx(kStep * (stiffness * depth + mass * kGravity)).epsilon(1e-2));
  }
}

TEST_CASE("the effective mass says what a kick does") {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> any(-1, 1);
  const auto vector = [&] { return Vec3(any(random), any(random), any(random)); };
  for (int i = 0; i < 100; ++i) {
    const BodyInertia inertia = BodyInertia::Of(0.3, Vec3(2e-4, 5e-4, 6e-4).asDiagonal());
    BodyState state{
        .pose = {.position = vector(),
                 .orientation = Quat(1.2, any(random), any(random), any(random)).normalized()}};
    const Vec3 point = state.pose.position + 0.1 * vector();
    const Vec3 direction = vector().normalized();
    const double yield = InverseEffectiveMass(inertia, state.pose, point, direction);
    ApplyImpulse(inertia, direction, (point - state.pose.position).cross(direction), state);
    REQUIRE(yield == Approx(state.VelocityAt(point).dot(direction)).epsilon(1e-12));
  }
}

TEST_CASE("a time is divided into substeps that are at most a quarter too long") {
  CHECK(SubstepCount(0.001, 0.001) == 1);
  CHECK(SubstepCount(0.00124, 0.001) == 1);
  CHECK(SubstepCount(0.00126, 0.001) == 2);
  CHECK(SubstepCount(0.0022, 0.001) == 2);
  CHECK(SubstepCount(0.01, 0.001) == 10);
  CHECK(SubstepCount(0.0001, 0.001) == 1);
  CHECK(SubstepCount(0, 0.001) == 1);
  CHECK(SubstepCount(-1, 0.001) == 1);
  CHECK(SubstepCount(1, std::numeric_limits<double>::infinity()) == 1);
  CHECK(SubstepCount(1, 0) == 1'000'000);
  CHECK(SubstepCount(std::numeric_limits<double>::infinity(), 0.001) == 1'000'000);
  CHECK(SubstepCount(0, 0) == 1);
  CHECK(SubstepCount(std::numeric_limits<double>::quiet_NaN(), 0.001) == 1);
  for (double time = 1e-4; time < 0.1; time *= 1.07) {
    const int count = SubstepCount(time, 0.001);
    CHECK(time / count <= 0.00125 * (1 + 1e-12));
    if (count > 1) CHECK(time / (count - 1) > 0.001);
  }
}

}  // namespace rikiseki
