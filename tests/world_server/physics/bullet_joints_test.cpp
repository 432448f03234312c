// SPDX-License-Identifier: MIT
// Jointed bodies in the engine, against closed forms.
#include "world_server/physics/bullet_joints.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "tests/world_server/jointed_scenes.h"
#include "world_server/physics/bullet_world.h"
#include "world_server/physics/linkage.h"

namespace rikiseki::world {
namespace {

using test::Apart;
using test::Block;
using test::Door;
using test::Floor;
using test::JoinAt;
using test::kDoorInertia;
using test::kPendulumInertia;
using test::Pendulum;

constexpr double kSubstep = 1e-3;
constexpr double kGravity = 9.81;

void Push(BulletWorld& world, std::size_t body, const Vec3& impulse,
          const Vec3& angular_impulse = Vec3::Zero()) {
  const Kick kick{.body = body, .impulse = impulse, .angular_impulse = angular_impulse};
  world.ApplyAndStep({&kick, 1}, 0);
}

std::vector<BodyState> States(const BulletWorld& world) {
  std::vector<BodyState> states;
  for (std::size_t i = 0; i < world.body_count(); ++i) states.push_back(world.State(i));
  return states;
}

// Kinetic and potential, J.
double Energy(const Scene& scene, const std::vector<BodyState>& states) {
  double energy = 0;
  for (std::size_t i = 0; i < states.size(); ++i) {
    const SceneBody& body = scene.bodies[i];
    if (body.fixed) continue;
    const Vec3 spin = states[i].pose.orientation.conjugate() * states[i].angular_velocity;
    energy += body.mass_kg * (states[i].velocity.squaredNorm() / 2 -
                              scene.gravity.dot(states[i].pose.position)) +
              spin.dot(body.inertia * spin) / 2;
  }
  return energy;
}

Vec3 AngularMomentum(const Scene& scene, const std::vector<BodyState>& states) {
  Vec3 sum = Vec3::Zero();
  for (std::size_t i = 0; i < states.size(); ++i) {
    const Quat& q = states[i].pose.orientation;
    sum += q * (scene.bodies[i].inertia * (q.conjugate() * states[i].angular_velocity)) +
           scene.bodies[i].mass_kg * states[i].pose.position.cross(states[i].velocity);
  }
  return sum;
}

double AngleOf(const BodyState& state, const Vec3& axis) {
  const Quat& q = state.pose.orientation;
  return std::remainder(2 * std::atan2(q.vec().dot(axis), q.w()), 2 * std::numbers::pi);
}

// A chain of `count` rods that hangs from the origin, held out horizontally.
Scene Chain(int count, double first_kg, double ratio) {
  Scene scene;
  double mass = first_kg;
  for (int i = 0; i < count; ++i, mass *= ratio) {
    scene.bodies.push_back(Block({0.1, 0.01, 0.01}, mass, {.position = {0.1 * i + 0.05, 0, 0}}));
    scene.bodies.back().model = 1;  // its links do not meet
    const std::size_t parent = i == 0 ? Joint::kWorld : static_cast<std::size_t>(i) - 1;
    scene.joints.push_back(JoinAt(scene, Joint::Type::kRevolute, parent,
                                  static_cast<std::size_t>(i), {0.1 * i, 0, 0}, Vec3::UnitY()));
  }
  return scene;
}

}  // namespace

TEST_CASE("a pendulum of any amplitude has its period, its energy and its pin") {
  const double slow = std::sqrt(2 * kGravity * 0.2 / kPendulumInertia);  // rad/s, of small swings
  for (const double amplitude : {0.1, 1.0, 2.5}) {
    const Scene scene = Pendulum(amplitude);
    BulletWorld world(scene, kSubstep);
    const double start = Energy(scene, States(world));
    const double depth = 2 * kGravity * 0.2 * (1 - std::cos(amplitude));  // J, that swings
    double last = amplitude;
    double crossed = 0, apart = 0, energy = 0;
    int crossings = 0;
    for (int i = 1; crossings < 9; ++i) {
      REQUIRE(i < 20000);
      world.ApplyAndStep({}, kSubstep);
      const double angle = AngleOf(world.State(0), Vec3::UnitY());
      if (angle * last < 0) {
        crossed = kSubstep * (i - angle / (angle - last));
        ++crossings;
      }
      last = angle;
      apart = std::max(apart, Apart(scene, States(world)));
      energy = std::max(energy, std::abs(Energy(scene, States(world)) - start));
    }
    // The ninth crossing is after 2 1/4 + 2 periods.
    const double period = 4 * std::comp_ellint_1(std::sin(amplitude / 2)) / slow;
    CAPTURE(amplitude, crossed / 4.25 / period - 1, apart, energy / depth);
    // A second-order rule errs by (w h)^2 / 24 = 1.5e-6 of the period at 6 rad/s, a few times more
    // where it turns faster.
    CHECK(crossed / 4.25 == Approx(period).epsilon(1e-5));
    CHECK(apart < 1e-11);
    // It swings about the energy by (w h)^2 of it.
    CHECK(energy < 1e-4 * depth);
  }
}

TEST_CASE("a door kicked off its centre takes J r / I about its hinge, at once") {
  const Scene scene = Door();
  BulletWorld world(scene, kSubstep);
  const Vec3 impulse(3, 5, 2);
  const Vec3 arm(0.3, -0.02, 0.4);  // from its centre, at 0.7 m from the hinge
  Push(world, 0, impulse, arm.cross(impulse));
  const double speed = (0.7 * 5 + 0.02 * 3) / kDoorInertia;
  CHECK((world.State(0).angular_velocity - Vec3(0, 0, speed)).norm() < 1e-12);
  CHECK((world.State(0).velocity - Vec3(0, 0.4 * speed, 0)).norm() < 1e-12);
  // Nothing works on it then: it turns steadily, about its hinge. A second-order rule is (w h)^2 / 8
  // of the angle off.
  for (int i = 0; i < 40; ++i) world.ApplyAndStep({}, 0.05);
  CHECK(AngleOf(world.State(0), Vec3::UnitZ()) ==
        Approx(2 * speed).epsilon(speed * speed * kSubstep * kSubstep / 4));
  CHECK(world.State(0).angular_velocity.z() == Approx(speed).epsilon(1e-9));
  CHECK(Apart(scene, States(world)) < 1e-11);
}

TEST_CASE("a joint between bodies that cannot move holds nothing, and nothing falls over it") {
  Scene scene = Door();
  for (SceneBody& body : scene.bodies) body.fixed = true;
  CHECK(Linkage::Of(scene).empty());
  BulletWorld world(scene, kSubstep);
  const std::vector<BodyState> before = States(world);
  world.ApplyAndStep({}, 100);
  for (std::size_t i = 0; i < before.size(); ++i) {
    CHECK(world.State(i).pose.position == before[i].pose.position);
  }
}

TEST_CASE("two hinges hold a door as one does") {
  Scene scene = Door();
  BulletWorld one(scene, kSubstep);
  scene.joints.push_back(
      JoinAt(scene, Joint::Type::kRevolute, Joint::kWorld, 0, {0, 0, 1.5}, Vec3::UnitZ()));
  BulletWorld two(scene, kSubstep);
  for (BulletWorld* world : {&one, &two}) {
    Push(*world, 0, {0, 5, 0});
    for (int i = 0; i < 20; ++i) world->ApplyAndStep({}, 0.05);
  }
  CHECK((one.State(0).pose.position - two.State(0).pose.position).norm() < 1e-9);
  CHECK((one.State(0).angular_velocity - two.State(0).angular_velocity).norm() < 1e-9);
}

TEST_CASE("what slides on a rail falls by g sin a, and stops by its friction where it should") {
  const double lean = 0.5;
  const Vec3 along(std::cos(lean), 0, -std::sin(lean));
  Scene scene;
  scene.bodies = {Block({0.1, 0.06, 0.04}, 2, {})};
  // The rail passes beside the centre: the block would turn if it could.
  scene.joints = {JoinAt(scene, Joint::Type::kPrismatic, Joint::kWorld, 0, {0, 0.1, 0.2}, along)};
  {
    BulletWorld world(scene, kSubstep);
    Push(world, 0, {0.4, 0.3, 1});
    const double speed = Vec3(0.4, 0.3, 1).dot(along) / 2;
    CHECK((world.State(0).velocity - speed * along).norm() < 1e-12);
    for (int i = 0; i < 20; ++i) world.ApplyAndStep({}, 0.05);
    const double acceleration = kGravity * std::sin(lean);
    CHECK((world.State(0).pose.position - (speed + acceleration / 2) * along).norm() < 1e-9);
    CHECK((world.State(0).velocity - (speed + acceleration) * along).norm() < 1e-9);
    CHECK(world.State(0).angular_velocity.norm() < 1e-12);
  }
  scene.joints[0].friction = 14;  // N; its weight along the rail is 9.41
  BulletWorld world(scene, kSubstep);
  for (int i = 0; i < 20; ++i) world.ApplyAndStep({}, 0.05);
  CHECK(world.State(0).pose.position.norm() < 1e-12);  // holds it
  Push(world, 0, 2 * along);
  for (int i = 0; i < 20; ++i) world.ApplyAndStep({}, 0.05);
  const double braking = 14.0 / 2 - kGravity * std::sin(lean);
  const double way = 1 / (2 * braking);
  // The substep in which it stops is not moved by the time that is left of it: a h^2 / 2 at most.
  CHECK((world.State(0).pose.position - way * along).norm() < braking * kSubstep * kSubstep);
  CHECK(world.State(0).velocity.norm() < 1e-12);
}

TEST_CASE("a wheel stops by the friction of its bearing in I w / M, and by damping never") {
  Scene scene = Door();
  scene.joints[0].friction = 3;  // N m
  BulletWorld braked(scene, kSubstep);
  Push(braked, 0, {0, 5, 0});
  const double speed = 0.4 * 5 / kDoorInertia;
  const double time = kDoorInertia * speed / 3;
  for (int i = 0; i < 1000; ++i) {
    braked.ApplyAndStep({}, kSubstep);
    if ((i + 1) * kSubstep < time) {
      REQUIRE(braked.State(0).angular_velocity.z() ==
              Approx(speed * (1 - (i + 1) * kSubstep / time)).margin(1e-9));
    } else if (i * kSubstep > time) {
      REQUIRE(std::abs(braked.State(0).angular_velocity.z()) < 1e-12);
    }
  }
  REQUIRE(time < 1);
  CHECK(AngleOf(braked.State(0), Vec3::UnitZ()) == Approx(speed * time / 2).margin(1e-6));

  scene.joints[0].friction = 0;
  scene.joints[0].damping = 8;  // N m s
  BulletWorld damped(scene, 10e-3);
  Push(damped, 0, {0, 5, 0});
  const double rate = 8 / kDoorInertia;
  for (int i = 1; i <= 40; ++i) {
    damped.ApplyAndStep({}, 0.05);
    REQUIRE(damped.State(0).angular_velocity.z() ==
            Approx(speed * std::exp(-rate * 0.05 * i)).epsilon(1e-9));
  }
  // The way by the trapezoidal rule: (rate h)^2 / 12 off.
  CHECK(AngleOf(damped.State(0), Vec3::UnitZ()) ==
        Approx(speed * -std::expm1(-rate * 2) / rate).epsilon(rate * rate * 1e-4 / 6));
}

TEST_CASE("limits hold, and nothing bounces off them") {
  Scene scene = Door();
  scene.joints[0].lower = -0.2;
  scene.joints[0].upper = 0.3;
  BulletWorld world(scene, kSubstep);
  Push(world, 0, {0, 20, 0});
  double furthest = 0;
  for (int i = 0; i < 1000; ++i) {
    world.ApplyAndStep({}, kSubstep);
    furthest = std::max(furthest, AngleOf(world.State(0), Vec3::UnitZ()));
  }
  CHECK(furthest <= 0.3 + 1e-9);
  CHECK(AngleOf(world.State(0), Vec3::UnitZ()) == Approx(0.3).margin(1e-9));
  CHECK(world.State(0).angular_velocity.norm() < 1e-12);
  Push(world, 0, {0, 20, 0});  // against the stop: nothing
  CHECK(world.State(0).angular_velocity.norm() < 1e-12);
  Push(world, 0, {0, -20, 0});
  CHECK(world.State(0).angular_velocity.z() < -0.5);
  for (int i = 0; i < 40; ++i) world.ApplyAndStep({}, 0.05);
  CHECK(AngleOf(world.State(0), Vec3::UnitZ()) == Approx(-0.2).margin(1e-9));

  Scene leaning = Pendulum(1);
  leaning.joints[0].lower = -0.25;
  BulletWorld hanging(leaning, kSubstep);
  for (int i = 0; i < 40; ++i) hanging.ApplyAndStep({}, 0.05);
  CHECK(AngleOf(hanging.State(0), Vec3::UnitY()) == Approx(0.75).margin(1e-9));
  CHECK(hanging.State(0).angular_velocity.norm() < 1e-12);
}

TEST_CASE("a limit of many turns is reached after them") {
  Scene scene = Door();
  scene.joints[0].upper = 20;
  BulletWorld world(scene, kSubstep);
  Push(world, 0, {0, 100, 0});
  const double speed = 0.4 * 100 / kDoorInertia;
  const double time = 20 / speed;
  double now = 0;
  for (; now < time - 0.1; now += 0.05) {
    world.ApplyAndStep({}, 0.05);
    REQUIRE(world.State(0).angular_velocity.z() == Approx(speed).epsilon(1e-6));
  }
  for (int i = 0; i < 10; ++i) world.ApplyAndStep({}, 0.05);
  CHECK(world.State(0).angular_velocity.norm() < 1e-9);
  const double at = AngleOf(world.State(0), Vec3::UnitZ()) - 20;
  CHECK(std::abs(std::remainder(at, 2 * std::numbers::pi)) < 1e-6);
}

TEST_CASE("chains keep their pins and their energy, whatever is the heavier link") {
  for (const auto& [count, ratio] : {std::pair{2, 100.0}, {2, 0.01}, {2, 1.0}, {8, 1.0}}) {
    const Scene scene = Chain(count, 0.1, ratio);
    BulletWorld world(scene, kSubstep);
    const double start = Energy(scene, States(world));
    double apart = 0, drift = 0, kinetic = 0;
    for (int i = 0; i < 2000; ++i) {
      world.ApplyAndStep({}, kSubstep);
      const std::vector<BodyState> states = States(world);
      apart = std::max(apart, Apart(scene, states));
      drift = std::max(drift, std::abs(Energy(scene, states) - start));
      for (std::size_t j = 0; j < states.size(); ++j) {
        kinetic = std::max(kinetic, scene.bodies[j].mass_kg * states[j].velocity.squaredNorm() / 2);
      }
    }
    CAPTURE(count, ratio, apart, drift / kinetic);
    CHECK(apart < 1e-10);
    // (w h)^2 of what swings; the light end of a chain whips at 100 rad/s and more.
    CHECK(drift < 1e-2 * kinetic);
    CHECK(kinetic > 0.01);
  }
}

TEST_CASE("two jointed bodies in flight keep momentum and angular momentum") {
  for (const Joint::Type type :
       {Joint::Type::kRevolute, Joint::Type::kPrismatic, Joint::Type::kBall}) {
    Scene scene;
    scene.gravity.setZero();
    scene.bodies = {Block({0.1, 0.2, 0.05}, 1, {}),
                    Block({0.05, 0.1, 0.3}, 0.3, {.position = {0.1, 0.2, 0}})};
    scene.joints = {JoinAt(scene, type, 0, 1, {0.05, 0.1, 0.02}, Vec3(1, 2, 2) / 3)};
    scene.joints[0].damping = 0.01;
    scene.joints[0].friction = 0.001;
    BulletWorld world(scene, kSubstep);
    const Vec3 impulse(0.2, -0.1, 0.3);
    const Vec3 angular(0.01, 0.005, -0.01);
    Push(world, 1, impulse, angular);
    const Vec3 momentum = AngularMomentum(scene, States(world));
    CHECK((momentum - angular - Vec3(0.1, 0.2, 0).cross(impulse)).norm() < 1e-12);
    for (int i = 0; i < 40; ++i) world.ApplyAndStep({}, 0.05);
    const Vec3 sum = world.State(0).velocity + 0.3 * world.State(1).velocity;
    CAPTURE(static_cast<int>(type), (AngularMomentum(scene, States(world)) - momentum).norm());
    CHECK((sum - impulse).norm() < 1e-11);
    CHECK((AngularMomentum(scene, States(world)) - momentum).norm() < 1e-9);
    CHECK(Apart(scene, States(world)) < 1e-11);
  }
}

TEST_CASE("a spinning top on its tip keeps energy and the momentum about the vertical") {
  const Quat tilted(Eigen::AngleAxisd(0.4, Vec3::UnitX()));
  Scene scene;
  scene.bodies = {
      Block({0.1, 0.1, 0.02}, 0.5, {.position = tilted * Vec3(0, 0, 0.05), .orientation = tilted})};
  scene.joints = {JoinAt(scene, Joint::Type::kBall, Joint::kWorld, 0, Vec3::Zero(), Vec3::UnitZ())};
  BulletWorld world(scene, kSubstep);
  Push(world, 0, Vec3::Zero(), tilted * Vec3(0, 0, 0.5 * 0.02 / 12 * 100));  // 100 rad/s
  const double energy = Energy(scene, States(world));
  const double spin = AngularMomentum(scene, States(world)).z();
  double lowest = 1;
  for (int i = 0; i < 2000; ++i) {
    world.ApplyAndStep({}, kSubstep);
    lowest = std::min(lowest, world.State(0).pose.position.z());
  }
  CAPTURE(Energy(scene, States(world)) / energy - 1,
          AngularMomentum(scene, States(world)).z() / spin - 1, lowest);
  CHECK(Energy(scene, States(world)) == Approx(energy).epsilon(1e-4));
  CHECK(AngularMomentum(scene, States(world)).z() == Approx(spin).epsilon(1e-9));
  CHECK(lowest > 0.03);  // it does not fall
  CHECK(Apart(scene, States(world)) < 1e-11);
}

TEST_CASE("a wagon stands still, and rolls without slipping or loss") {
  Scene scene;
  scene.bodies = {Floor(0.8), Block({0.4, 0.2, 0.06}, 5, {.position = {0, 0, 0.06}})};
  const double radius = 0.05;
  for (const double x : {-0.15, 0.15}) {
    for (const double y : {-0.13, 0.13}) {
      SceneBody wheel;
      wheel.name = "wheel";
      wheel.mass_kg = 0.05;
      const double across = 0.05 * (3 * radius * radius + 0.02 * 0.02) / 12;
      wheel.inertia = Vec3(across, across, 0.05 * radius * radius / 2).asDiagonal();
      wheel.pose_WB = {.position = {x, y, radius},
                       .orientation = Quat(Eigen::AngleAxisd(std::numbers::pi / 2, Vec3::UnitX()))};
      wheel.colliders.push_back({.shape = Cylinder{radius, 0.01}, .friction = 0.8});
      scene.bodies.push_back(wheel);
      scene.joints.push_back(JoinAt(scene, Joint::Type::kRevolute, 1, scene.bodies.size() - 1,
                                    wheel.pose_WB.position, Vec3::UnitY()));
    }
  }
  BulletWorld world(scene, kSubstep);
  for (int i = 0; i < 20; ++i) world.ApplyAndStep({}, 0.05);
  const Vec3 rest = world.State(1).pose.position;
  CAPTURE(rest.transpose());
  CHECK(std::abs(rest.z() - 0.06) < 1e-4);
  for (int i = 0; i < 20; ++i) world.ApplyAndStep({}, 0.05);
  CHECK((world.State(1).pose.position - rest).norm() < 1e-6);
  // 0.5 N s, slowly enough for the wheels to follow: v = J / (M + 4 m + 4 I / r^2).
  for (int i = 0; i < 100; ++i) {
    Push(world, 1, {0.005, 0, 0});
    world.ApplyAndStep({}, kSubstep);
  }
  const double speed = 0.5 / (5 + 4 * 0.05 * 1.5);
  for (int i = 0; i < 20; ++i) world.ApplyAndStep({}, 0.05);
  CAPTURE(world.State(1).velocity.x() / speed - 1,
          world.State(2).angular_velocity.y() * radius / speed - 1);
  for (std::size_t wheel = 2; wheel < 6; ++wheel) {
    CHECK(world.State(wheel).angular_velocity.y() == Approx(speed / radius).epsilon(1e-6));
  }
  CHECK(world.State(1).velocity.x() == Approx(speed).epsilon(1e-6));
  CHECK(std::abs(world.State(1).velocity.y()) < 1e-3);
  CHECK(Apart(scene, States(world)) < 1e-11);
}

TEST_CASE("a bridge on a hinge rests on a block, and the block bears half of it") {
  Scene scene;
  scene.bodies = {Floor(0.5), Block({0.6, 0.1, 0.02}, 4, {.position = {0.3, 0, 0.11}}),
                  Block({0.1, 0.1, 0.1}, 0.1, {.position = {0.55, 0, 0.05}})};
  scene.joints = {
      JoinAt(scene, Joint::Type::kRevolute, Joint::kWorld, 1, {0, 0, 0.11}, Vec3::UnitY())};
  BulletWorld world(scene, kSubstep);
  for (int i = 0; i < 100; ++i) world.ApplyAndStep({}, 0.05);
  const Vec3 rest = world.State(2).pose.position;
  CHECK((rest - Vec3(0.55, 0, 0.05)).norm() < 2e-4);
  CHECK(std::abs(AngleOf(world.State(1), Vec3::UnitY())) < 1e-3);
  for (int i = 0; i < 20; ++i) world.ApplyAndStep({}, 0.05);
  CHECK((world.State(2).pose.position - rest).norm() < 1e-6);
}

TEST_CASE(
    "jointed bodies and links of one model pass through each other, and told to, links do not") {
  // Two cubes, one inside the other by half.
  Scene scene;
  scene.gravity.setZero();
  scene.bodies = {Block({0.1, 0.1, 0.1}, 1, {}),
                  Block({0.1, 0.1, 0.1}, 1, {.position = {0.05, 0, 0}})};
  const auto moved = [&] {
    BulletWorld world(scene, kSubstep);
    for (int i = 0; i < 10; ++i) world.ApplyAndStep({}, 0.05);
    return (world.State(0).pose.position - Vec3::Zero()).norm() +
           (world.State(1).pose.position - Vec3(0.05, 0, 0)).norm();
  };
  CHECK(Collide(scene, 0, 1));
  CHECK(moved() > 0.01);
  scene.bodies[0].model = scene.bodies[1].model = 7;
  CHECK_FALSE(Collide(scene, 0, 1));
  CHECK(moved() == 0);
  scene.bodies[1].self_collides = true;
  CHECK(Collide(scene, 0, 1));
  CHECK(moved() > 0.01);
  scene.joints = {JoinAt(scene, Joint::Type::kRevolute, 0, 1, Vec3::Zero(), Vec3::UnitX())};
  CHECK_FALSE(Collide(scene, 0, 1));
  CHECK(moved() < 1e-12);
}

TEST_CASE("a linkage sleeps as one, and a push on one of its bodies wakes all") {
  Scene scene = Chain(3, 0.1, 1);
  scene.gravity.setZero();
  BulletWorld world(scene, kSubstep);
  for (int i = 0; i < 60; ++i) world.ApplyAndStep({}, 0.05);
  Push(world, 2, {0, 0, 0.01});
  CHECK(world.State(2).velocity.z() > 0.01);
  CHECK(world.State(1).velocity.norm() > 1e-3);
  CHECK(world.State(0).velocity.norm() > 1e-4);
  const Vec3 before = world.State(0).pose.position;
  world.ApplyAndStep({}, 0.05);
  CHECK((world.State(0).pose.position - before).norm() > 1e-5);
  CHECK(Apart(scene, States(world)) < 1e-11);
}

TEST_CASE("no speed tears a joint or leaves the numbers") {
  for (const double impulse : {1e2, 1e4, 1e8}) {
    Scene scene = Chain(3, 0.1, 1);
    BulletWorld world(scene, kSubstep);
    Push(world, 2, {0, impulse, impulse});
    for (int i = 0; i < 200; ++i) {
      world.ApplyAndStep({}, kSubstep);
      for (const BodyState& state : States(world)) {
        REQUIRE(state.pose.position.allFinite());
        REQUIRE(state.pose.position.norm() < 0.4);
        REQUIRE(state.velocity.allFinite());
      }
      REQUIRE(Apart(scene, States(world)) < 1e-6);
    }
  }
}

TEST_CASE("jointed bodies: the same calls give the same bits") {
  const Scene scene = Chain(4, 0.1, 3);
  BulletWorld first(scene, kSubstep), second(scene, kSubstep);
  for (int i = 0; i < 20; ++i) {
    first.ApplyAndStep({}, 0.05);
    second.ApplyAndStep({}, 0.05);
  }
  for (std::size_t i = 0; i < 4; ++i) {
    CHECK(first.State(i).pose.position == second.State(i).pose.position);
    CHECK(first.State(i).angular_velocity == second.State(i).angular_velocity);
  }
}

}  // namespace rikiseki::world
