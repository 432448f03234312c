// SPDX-License-Identifier: MIT
// A scene that changes while a finger is in it, in virtual time: what the change does not speak of
// feels as if nothing had happened, to the bit; what appears, vanishes or jumps under the finger does
// not step the force.
#include <algorithm>
#include <catch2/catch.hpp>
#include <functional>
#include <memory>
#include <vector>

#include "protocol/impulse_units.h"
#include "tests/lab/coupled_run.h"
#include "tests/lab/prescribed_device.h"
#include "world_server/physics/bullet_world.h"

namespace rikiseki::lab {
namespace {

constexpr double kPeriod = 1e-3;     // s
constexpr double kStiffness = 2000;  // N/m, of the default settings
constexpr double kDamping = 2;       // N s/m, likewise
constexpr double kDepth = 2e-3;      // m, of the finger in the wall
constexpr double kRecovery = 0.1;    // s, of the haptic side
constexpr int kPressed = 400;        // ticks until the force is there: soft start and all
constexpr int kAfter = 600;          // ticks that are watched after the change

world::SceneBody Fixed(const std::string& name, const world::Shape& shape, const Vec3& position) {
  world::SceneBody body;
  body.name = name;
  body.fixed = true;
  body.pose_WB.position = position;
  body.colliders.push_back({.shape = shape, .friction = 0.3});
  return body;
}

world::SceneBody Cube(const std::string& name, const Vec3& position) {
  world::SceneBody body = Fixed(name, world::Box{Vec3::Constant(0.03)}, position);
  body.fixed = false;
  body.mass_kg = 0.5;
  body.inertia = Mat3::Identity() * 3e-4;
  return body;
}

// A wall with its face at x = 0, a floor, and far away a cube that falls on it.
world::Scene Base() {
  world::Scene scene;
  scene.name = "changing";
  scene.bodies = {Fixed("wall", world::Box{Vec3(0.05, 0.2, 0.2)}, Vec3(0.05, 0, 0)),
                  Fixed("floor", world::HalfSpace{}, Vec3(0, 0, -0.3)),
                  Cube("cube", Vec3(-0.5, 0.4, 0.5))};
  return scene;
}

struct Seen {
  std::vector<Vec3> forces;   // of every tick, on the finger
  std::vector<Vec3> cube;     // where the cube is, after every world tick
  double largest_step_n = 0;  // of the force, after the change
  bool books_balance = false;
};

// A finger rests where `x` says, and after a while the scene becomes `changed`, if that has bodies.
Seen Press(double x, const world::Scene& changed,
           world::Replacement how = world::Replacement::kChange) {
  const haptic::Settings haptic_settings;
  const world::Settings world_settings;
  const auto dynamics = [](const world::Scene& scene) {
    return std::make_unique<world::BulletWorld>(scene, 1e-3);
  };
  PrescribedDevice finger(
      [x](double t_s) {
        return Vec3(x - 0.02 * std::max(0.0, 1 - t_s / 0.1), 0, 0);  // comes from 2 cm away
      },
      CoupledRun::StartNs(haptic_settings) + 100'000'000);
  const world::Scene scene = Base();
  CoupledRun run(haptic_settings, finger, world_settings, scene, dynamics(scene), 7);
  Seen seen;
  for (int k = 0; k < kPressed + kAfter; ++k) {
    if (k == kPressed && !changed.bodies.empty()) run.ReplaceScene(changed, dynamics(changed), how);
    const bool world_ticked = run.Tick();
    seen.forces.push_back(ToVec3(run.haptic_tick().pointers[0].force));
    if (k > kPressed) {
      const Vec3 step = seen.forces.back() - seen.forces[seen.forces.size() - 2];
      seen.largest_step_n = std::max(seen.largest_step_n, step.norm());
    }
    if (!world_ticked) continue;
    for (std::size_t i = 0; i < run.world().Bodies().size(); ++i) {
      if (run.world().scene().bodies[i].name != "cube") continue;
      seen.cube.push_back(ToVec3(run.world().Bodies()[i].position));
    }
  }
  const protocol::Books& books = run.haptic_health().books;
  seen.books_balance = books.covered == protocol::Plus(books.applied, books.discarded);
  return seen;
}

constexpr double kPressing = kDepth - 0.01;  // the centre of the finger, of 10 mm radius

}  // namespace

TEST_CASE("a change elsewhere: the pressed wall feels the same to the bit, what falls goes on") {
  const Seen undisturbed = Press(kPressing, {});
  REQUIRE(undisturbed.forces.back().x() == Approx(-kStiffness * kDepth).epsilon(1e-9));
  const auto same = [&](const world::Scene& changed) {
    const Seen seen = Press(kPressing, changed);
    CHECK(seen.forces == undisturbed.forces);
    CHECK(seen.books_balance);
    // Free fall is exact, at any substep: only rounding is left. It lands after 0.4 s.
    REQUIRE(seen.cube.size() == undisturbed.cube.size());
    double worst = 0;
    for (std::size_t i = 0; i < seen.cube.size(); ++i) {
      worst = std::max(worst, (seen.cube[i] - undisturbed.cube[i]).norm());
    }
    CHECK(worst <= 1e-6);
  };
  world::Scene changed = Base();
  changed.bodies.insert(changed.bodies.begin(), Cube("new", Vec3(-0.5, -0.4, -0.27)));
  same(changed);
  changed = Base();
  changed.bodies.push_back(Fixed("new", world::Sphere{0.05}, Vec3(-0.5, -0.4, 0)));
  std::swap(changed.bodies[0], changed.bodies[2]);
  same(changed);
  changed = Base();
  changed.bodies[1].colliders[0].friction = 0.2;
  same(changed);
}

TEST_CASE("removed, moved or put back: what was pressed and is still there feels the same") {
  const Seen undisturbed = Press(kPressing, {});
  world::Scene changed = Base();
  changed.bodies.pop_back();
  CHECK(Press(kPressing, changed).forces == undisturbed.forces);
  changed = Base();
  changed.bodies[2].pose_WB.position = Vec3(-0.3, 0.2, 0.1);
  const Seen moved = Press(kPressing, changed);
  CHECK(moved.forces == undisturbed.forces);
  CHECK((moved.cube.back() - Vec3(-0.3, 0.2, -0.27)).norm() < 1e-4);  // it fell on the floor
  CHECK(Press(kPressing, Base(), world::Replacement::kRestart).forces == undisturbed.forces);
}

TEST_CASE("what appears under the finger comes within the recovery time, without a step") {
  const double free_x = -0.2;
  world::Scene changed = Base();
  const double depth = 4e-3;
  changed.bodies.push_back(
      Fixed("new", world::Box{Vec3::Constant(0.03)}, Vec3(free_x + 0.04 - depth, 0, 0)));
  const Seen seen = Press(free_x, changed);
  CHECK(seen.forces[kPressed - 1] == Vec3::Zero());
  CHECK(seen.forces.back().x() == Approx(-kStiffness * depth).epsilon(1e-6));
  // It rises by its depth in the recovery time, evenly: the spring grows by as much in a tick, and
  // the damper sets in.
  CHECK(seen.largest_step_n <= (kStiffness * kPeriod + kDamping) * depth / kRecovery * 1.001);
  CHECK(seen.largest_step_n > 0);
}

TEST_CASE("what is pressed and vanishes fades within the recovery time, without a step") {
  world::Scene changed = Base();
  changed.bodies.erase(changed.bodies.begin());
  const Seen seen = Press(kPressing, changed);
  CHECK(seen.forces[kPressed - 1].x() == Approx(-kStiffness * kDepth).epsilon(1e-9));
  CHECK(seen.forces.back() == Vec3::Zero());
  CHECK(seen.largest_step_n <= kStiffness * kDepth / kRecovery * kPeriod * 1.001);
}

TEST_CASE("what is pressed and jumps is another thing: it comes anew, within the slew limit") {
  const double ahead = GENERATE(-3e-3, 3e-3);  // towards the finger, away from it
  world::Scene changed = Base();
  changed.bodies[0].pose_WB.position.x() += ahead;
  const Seen seen = Press(kPressing, changed);
  const haptic::Settings settings;
  CHECK(seen.largest_step_n <= settings.safety.slew_limit_n_per_s * kPeriod * (1 + 1e-9));
  const double depth = std::max(0.0, kDepth - ahead);
  CHECK(seen.forces.back().x() == Approx(-kStiffness * depth).epsilon(1e-6));
}

}  // namespace rikiseki::lab
