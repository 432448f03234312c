// SPDX-License-Identifier: MIT
// Local copies of jointed bodies against the world's engine: the haptic side, which knows no joints, gets
// planes that face each other (world_server/features/joint_sites.h). A copy made of one frame, pushed as
// the engine is and told nothing more, must be where the engine is when the next frames are due.
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>

#include "haptic_server/render/local_bodies.h"
#include "tests/world_server/jointed_scenes.h"
#include "world_server/features/local_bodies.h"
#include "world_server/physics/bullet_world.h"

namespace rikiseki::lab {
namespace {

using world::BulletWorld;
using world::Joint;
using world::Scene;
using world::test::Block;
using world::test::JoinAt;

constexpr double kTick = 1e-3;  // s
constexpr int kTicks = 100;     // two periods of 50 ms: as long as a frame is shown, at most

// The engine and the copies of its bodies, from one frame on.
class Pair {
 public:
  Pair(const Scene& scene, const std::vector<std::size_t>& near, double settle_s = 0,
       const world::Kick& kick = {})
      : engine_(scene, kTick), copies_(1'000'000, 256, 0, PositionRule::kSecondOrder) {
    engine_.ApplyAndStep({&kick, 1}, settle_s);
    std::vector<BodyState> states;
    for (std::size_t i = 0; i < scene.bodies.size(); ++i) states.push_back(engine_.State(i));
    std::vector<protocol::Plane> planes(near.size());
    for (std::size_t i = 0; i < near.size(); ++i) {
      planes[i].body = static_cast<std::uint32_t>(near[i]);
    }
    protocol::WorldFrame frame;
    frame.period_ns = 50'000'000;
    frame.local_substep_ns = 1'000'000;
    const std::vector<std::uint32_t> generations(scene.bodies.size());
    frame.local_body_count =
        world::FindLocalBodies(scene, engine_, states, generations, planes,
                               {.radius_m = 0.02, .period_s = 0.05}, frame.local_bodies);
    count_ = frame.local_body_count;
    copies_.Receive(frame, 0);
  }

  std::uint32_t count() const { return count_; }
  const BulletWorld& engine() const { return engine_; }

  // Pushes a body at a place in W, the same in both, for a tick.
  void Push(std::size_t body, const Vec3& point_W, const Vec3& force_n) {
    const Vec3 impulse = kTick * force_n;
    const world::PlacedImpulse push{body, impulse, point_W.cross(impulse)};
    const world::Stretch stretch{.length_s = kTick, .pushes = {&push, 1}};
    engine_.Play({&stretch, 1});
    const haptic::BodyImpulse same{static_cast<std::uint32_t>(body), 0, push.impulse,
                                   push.angular_impulse};
    copies_.Step(tick_++, {&same, 1}, kTick);
  }

  const BodyState& Copy(std::size_t body) const {
    const BodyState* copy = copies_.Find(static_cast<std::uint32_t>(body), 0);
    REQUIRE(copy != nullptr);
    return *copy;
  }

  // m: between a body's points at this distance from its centre, in engine and copy.
  double Off(std::size_t body, double radius_m) const {
    const BodyState truth = engine_.State(body);
    const Pose& copy = Copy(body).pose;
    return (truth.pose.position - copy.position).norm() +
           radius_m * truth.pose.orientation.angularDistance(copy.orientation);
  }

 private:
  BulletWorld engine_;
  haptic::LocalBodies copies_;
  std::uint32_t count_ = 0;
  std::uint64_t tick_ = 0;
};

// 20 x 14 cm and 300 g, hinged along z at y = 7 cm.
Scene SmallDoor() {
  Scene scene;
  scene.bodies = {Block({0.01, 0.14, 0.2}, 0.3, {})};
  scene.joints = {
      JoinAt(scene, Joint::Type::kRevolute, Joint::kWorld, 0, {0, 0.07, 0}, Vec3::UnitZ())};
  return scene;
}
constexpr double kSmallDoorInertia = 0.3 * ((0.01 * 0.01 + 0.14 * 0.14) / 12 + 0.07 * 0.07);

// A rider on a plate of 400 g that turns about z on the world.
Scene Turntable(double rider_kg, double rider_x) {
  Scene scene;
  scene.bodies = {world::test::Floor(0.3),
                  Block({0.2, 0.2, 0.01}, 0.4, {.position = {0, 0, 0.015}}),
                  Block({0.03, 0.03, 0.03}, rider_kg, {.position = {rider_x, 0, 0.035}})};
  scene.joints = {
      JoinAt(scene, Joint::Type::kRevolute, Joint::kWorld, 1, {0, 0, 0.015}, Vec3::UnitZ())};
  return scene;
}

}  // namespace

TEST_CASE("a copied door opens as the door does, about its hinge") {
  for (const double force_n : {0.02, 0.5, 4.0}) {
    Pair pair(SmallDoor(), {0});
    REQUIRE(pair.count() == 1);
    for (int k = 0; k < kTicks; ++k) pair.Push(0, {0.005, -0.05, 0.03}, {-force_n, 0, 0});
    const BodyState copy = pair.Copy(0);
    CAPTURE(force_n, pair.Off(0, 0.14));
    // Through a quarter of a turn at most. The copy goes on tangents: each tick takes its hinge
    // (w h)^2 r/2 out, a fifth of which comes back: at w = 24 rad/s 0.1 mm.
    CHECK(pair.Off(0, 0.14) < 3e-4);
    CHECK(((copy.pose * Vec3(0, 0.07, 0)) - Vec3(0, 0.07, 0)).norm() < 3e-4);
    const double speed = 0.12 * force_n * kTicks * kTick / kSmallDoorInertia;  // of a small angle
    if (force_n < 0.1) CHECK(copy.angular_velocity.z() == Approx(-speed).epsilon(1e-2));
  }
}

TEST_CASE("a copied door holds against pushes across its hinge, and stops at its limit") {
  {
    Pair pair(SmallDoor(), {0});
    // 10 N up at its edge, and along the door: 50 sweeps leave a thousandth of the tick's push.
    for (int k = 0; k < kTicks; ++k) pair.Push(0, {0, -0.07, 0.1}, {0, 7, 7});
    CHECK(pair.Off(0, 0.14) < 1e-5);
  }
  Scene scene = SmallDoor();
  scene.joints[0].upper = 0.05;
  Pair pair(scene, {0});
  for (int k = 0; k < kTicks; ++k) pair.Push(0, {0.005, -0.05, 0}, {1, 0, 0});
  CHECK(pair.engine().State(0).pose.orientation.angularDistance(Quat::Identity()) ==
        Approx(0.05).epsilon(1e-6));
  CHECK(pair.Off(0, 0.14) < 3e-4);
}

TEST_CASE("copies of a slide, of a ball joint and of a chain go where the engine goes") {
  for (const auto type : {Joint::Type::kPrismatic, Joint::Type::kBall}) {
    Scene scene;
    scene.bodies = {Block({0.1, 0.06, 0.04}, 0.2, {})};
    scene.joints = {JoinAt(scene, type, Joint::kWorld, 0, {0, 0.05, 0.03}, Vec3(1, 0, -0.3))};
    Pair pair(scene, {0});
    REQUIRE(pair.count() == 1);
    for (int k = 0; k < kTicks; ++k) pair.Push(0, {0.05, 0, 0}, {0.5, 0.3, 0.2});
    CAPTURE(static_cast<int>(type), pair.Off(0, 0.06));
    CHECK(pair.Off(0, 0.06) < 2e-3);
    CHECK((pair.engine().State(0).pose.position).norm() > 0.01);  // it went
  }
  Scene chain;
  for (int i = 0; i < 2; ++i) {
    chain.bodies.push_back(Block({0.1, 0.01, 0.01}, 0.1, {.position = {0.1 * i + 0.05, 0, 0}}));
    chain.bodies.back().model = 1;
  }
  chain.joints = {JoinAt(chain, Joint::Type::kRevolute, Joint::kWorld, 0, {0, 0, 0}, Vec3::UnitZ()),
                  JoinAt(chain, Joint::Type::kRevolute, 0, 1, {0.1, 0, 0}, Vec3::UnitZ())};
  Pair pair(chain, {1});
  REQUIRE(pair.count() == 2);
  for (int k = 0; k < kTicks; ++k) pair.Push(1, {0.18, 0.005, 0}, {0, -0.3, 0});
  CAPTURE(pair.Off(0, 0.05), pair.Off(1, 0.05));
  CHECK(pair.Off(0, 0.05) < 2e-3);
  CHECK(pair.Off(1, 0.05) < 2e-3);
}

TEST_CASE("friction and damping of a joint are in the copy") {
  Scene scene = SmallDoor();
  scene.joints[0].damping = 0.004;   // N m s
  scene.joints[0].friction = 0.005;  // N m
  const world::Kick kick{.impulse = {-0.03, 0, 0}};
  Pair pair(scene, {0}, 1e-3, kick);
  const double speed = 0.03 * 0.07 / kSmallDoorInertia;  // rad/s, 1.3
  for (int k = 0; k < kTicks; ++k) pair.Push(0, Vec3::Zero(), Vec3::Zero());
  // The copy brakes as at the frame; damping takes a quarter of the speed in 0.1 s, by which that is
  // w (c t)^2 t / 6 too much, on 7 cm to its centre and 14 beyond. Without friction and damping it is ten
  // times the bound, (3 + 2 w) t^2 / 2.
  const double rate = 0.004 / kSmallDoorInertia;  // 1/s
  const double time_s = kTicks * kTick;
  // Twice as much again for the angle of a copy, which is first order, and its hinge on tangents.
  CHECK(pair.Off(0, 0.14) < 3 * 0.21 * speed * rate * rate * time_s * time_s * time_s / 6);
  CHECK(pair.Copy(0).angular_velocity.z() < -0.5 * speed);
}

TEST_CASE("a rider on a jointed plate has a copy, and the plate with it") {
  for (const double rider_kg : {0.005, 0.05, 0.5}) {
    for (const double x : {0.0, 0.06, 0.085}) {
      Pair pair(Turntable(rider_kg, x), {2}, 0.2);
      CAPTURE(rider_kg, x);
      REQUIRE(pair.count() == 2);
      // Pressed onto the plate it takes the plate along by its friction.
      for (int k = 0; k < kTicks; ++k) pair.Push(2, {x, 0, 0.05}, {0, 0.5, -10});
      CAPTURE(pair.Off(2, 0.02), pair.Off(1, 0.1));
      CHECK(pair.Off(1, 0.1) < 1e-6);
      // The copy stands on its plate. The engine's rider may creep: what the solver leaves of a kick of
      // J/m a tick is slip, and half of what friction takes of the kick is then way (bullet_hooks.cpp).
      const Pose on_plate = pair.Copy(1).pose.Inverse() * pair.Copy(2).pose;
      CHECK((on_plate.position - Vec3(x, 0, 0.02)).norm() < 2e-5);
      CHECK(pair.Off(2, 0.02) < 2e-5 + kTicks * 0.5 * kTick / rider_kg * kTick / 2);
      if (x > 0) CHECK(pair.Copy(1).angular_velocity.z() > 0.1);
    }
  }
}

}  // namespace rikiseki::lab
