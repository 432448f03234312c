// SPDX-License-Identifier: MIT
// A scene that takes another's place while the loop runs: what it says differently changes, everything
// else goes on, on the wire and in the engine.
#include <algorithm>
#include <catch2/catch.hpp>
#include <string>
#include <utility>

#include "tests/world_server/scenes.h"
#include "world_server/physics/bullet_world.h"
#include "world_server/step.h"

namespace rikiseki::world {
namespace {

using protocol::HapticTick;
using protocol::WorldFrame;

constexpr double kPeriod = 0.05;

class Running {
 public:
  explicit Running(const Scene& scene, protocol::Coupling coupling = protocol::Coupling::kLocal)
      : step_(SettingsFor(coupling), scene, std::make_unique<BulletWorld>(scene, 1e-3), 0) {
    step_.BeginHapticEpoch(1);
    tick_.pointer_count = 2;
    tick_.pointers[0].position = {0, 0, 10};
    tick_.pointers[1].pointer = kPusher;
    tick_.pointers[1].position = {0, 0, 1000};
  }

  void Finger(const Vec3& position) {
    tick_.pointers[0].radius = 0.01;
    tick_.pointers[0].position = ToArray(position);
  }

  /// Another finger, far away, gives this impulse [1e-12 N s] in x to a body until the next tick.
  void Push(const protocol::Body& body, std::int64_t units) {
    tick_.channel_count = 1;
    protocol::Channel& channel = tick_.channels[0];
    if (channel.body != body.body || channel.generation != body.generation) {
      channel = {.body = body.body,
                 .generation = body.generation,
                 .pointer = kPusher,
                 .opened_tick = tick_.tick + 1};
    }
    channel.impulse[0] += units;
    way_ = units < 0 ? -1 : 1;
    Send();
  }

  void Send() {
    ++tick_.tick;
    tick_.start_ns += 1'000'000;
    tick_.period_ns = tick_.previous_duration_ns = 1'000'000;
    // It goes along, and has worked enough for whatever it gives.
    tick_.pointers[1].position[0] += way_;
    step_.Consume(tick_);
  }

  const WorldFrame& Tick() {
    Send();
    step_.Tick(kPeriod, frame_);
    return frame_;
  }

  void Change(const Scene& scene, Replacement how = Replacement::kChange) {
    step_.Replace(
        {.scene = scene, .dynamics = std::make_unique<BulletWorld>(scene, 1e-3), .how = how});
  }

  const protocol::Body& Body(std::size_t place) const { return step_.Bodies()[place]; }
  Vec3 Position(std::size_t place) const { return ToVec3(Body(place).position); }
  Vec3 Velocity(std::size_t place) const { return ToVec3(Body(place).velocity); }
  const WorldFrame& frame() const { return frame_; }
  WorldStep& step() { return step_; }

 private:
  static Settings SettingsFor(protocol::Coupling coupling) {
    Settings settings;
    settings.coupling.coupling = coupling;
    return settings;
  }

  static constexpr std::uint32_t kPusher = 1;

  double way_ = 0;  // m, of the other finger from message to message
  WorldStep step_;
  HapticTick tick_;
  WorldFrame frame_;
};

SceneBody Named(SceneBody body, const std::string& name) {
  body.name = name;
  return body;
}

// 0 floor, 1 cube, 2 a wall 1 m away.
Scene WallAndCube() {
  Scene scene = test::CubeOnFloor(0.3);
  SceneBody wall = Named(test::Floor(0.3), "wall::link");
  wall.colliders[0].shape = Box{Vec3(0.05, 0.2, 0.2)};
  wall.pose_WB.position = {-1, 0, 0.2};
  scene.bodies.push_back(wall);
  return scene;
}

// Ten boxes of 5 cm on a floor.
Scene Stack() {
  Scene scene;
  scene.bodies = {test::Floor(0.5)};
  for (int i = 0; i < 10; ++i) {
    scene.bodies.push_back(Named(test::Cube(0.05, 0.125, 0.5, {0, 0, 0.025 + 0.05 * i}),
                                 "box" + std::to_string(i) + "::link"));
  }
  return scene;
}

}  // namespace

TEST_CASE("a change keeps the names, the planes and the way of what it does not speak of") {
  const Scene scene = WallAndCube();
  Running changed(scene);
  Running undisturbed(scene);
  for (Running* world : {&changed, &undisturbed}) {
    world->Finger({-0.935, 0, 0.2});  // 5 mm in the wall
    world->Tick();
    world->Push(world->Body(1), 200'000'000'000);  // 0.2 m/s
    world->Tick();
  }
  REQUIRE(changed.Velocity(1).x() > 0.04);

  Scene other = scene;
  other.bodies.insert(other.bodies.begin(),
                      Named(test::Cube(0.06, 0.3, 0.3, {3, 0, 0.03}), "new::link"));
  std::swap(other.bodies[1], other.bodies[3]);  // new, wall, cube, floor
  changed.Change(other);
  CHECK(changed.step().health().resets == 1);
  CHECK(changed.Body(0).body == 3);  // never used before
  CHECK(changed.Body(0).generation == 1);
  CHECK(changed.Body(1).body == 2);
  CHECK(changed.Body(2).body == 1);
  CHECK(changed.Body(3).body == 0);
  for (std::size_t place = 0; place < 4; ++place) CHECK(changed.Body(place).generation == 1);

  for (int i = 0; i < 40; ++i) {
    const WorldFrame& a = changed.Tick();
    const WorldFrame& b = undisturbed.Tick();
    REQUIRE(a.plane_count == 1);
    REQUIRE(b.plane_count == 1);
    REQUIRE(a.planes[0].body == 2);
    REQUIRE(a.planes[0].generation == 1);
    REQUIRE(a.planes[0].feature == b.planes[0].feature);
    REQUIRE(a.planes[0].point == b.planes[0].point);
    REQUIRE(a.planes[0].normal == b.planes[0].normal);
    REQUIRE((changed.Position(2) - undisturbed.Position(1)).norm() <= 1e-6);
  }
  CHECK(undisturbed.Velocity(1).norm() < 1e-6);
}

TEST_CASE("what was prepared beside the loop costs the tick nothing but for what moves") {
  Scene scene;
  scene.name = "many";
  scene.bodies = {Named(test::Floor(0.4), "floor::link")};
  scene.bodies[0].pose_WB.position.z() = -0.01;  // pushes go through the origin
  for (int i = 0; i < 200; ++i) {
    scene.bodies.push_back(Named(test::Cube(0.02, 0.02, 0.4, {0.03 * (i % 20), 0.03 * (i / 20), 0}),
                                 "cube" + std::to_string(i) + "::link"));
  }
  Running world(scene);
  for (int i = 0; i < 4; ++i) world.Tick();
  world.Push(world.Body(1), -20'000'000'000);  // 1 m/s, away from the others
  world.Tick();
  Successor successor;
  successor.scene = scene;
  successor.scene.bodies.push_back(Named(test::Cube(0.02, 0.02, 0.4, {2, 2, 0}), "new::link"));
  auto dynamics = std::make_unique<BulletWorld>(successor.scene, 1e-3);
  const BulletWorld& engine = *dynamics;
  successor.dynamics = std::move(dynamics);
  Prepare(world.step().Now(), 1e-3, successor);
  CHECK(engine.awake() ==
        2);      // it, and the new one, which has to sink into its resting depth first
  world.Tick();  // the pushed one goes on meanwhile
  std::vector<Vec3> before;
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) before.push_back(world.Position(i));
  const Vec3 velocity = world.Velocity(1);
  REQUIRE(velocity.norm() > 0.1);

  const std::uint64_t prepared = engine.substeps();
  world.step().Replace(std::move(successor));
  CHECK(engine.substeps() == prepared);
  CHECK(engine.awake() == 2);
  CHECK(world.Velocity(1) == velocity);
  for (std::size_t i = 0; i < before.size(); ++i) CHECK(world.Position(i) == before[i]);
  CHECK(world.Body(201).body == 201);
  // Substeps of a millisecond for those two, and none for any other.
  world.Tick();
  CHECK(engine.substeps() - prepared <= 100);
  for (std::size_t i = 2; i < before.size(); ++i) CHECK(world.Position(i) == before[i]);
}

TEST_CASE("what a change puts elsewhere is there at rest, and another thing") {
  const Scene scene = WallAndCube();
  Running world(scene);
  world.Tick();
  world.Push(world.Body(1), 500'000'000'000);
  world.Tick();
  Scene moved = scene;
  moved.bodies[1].pose_WB.position.x() = 0.5;
  moved.bodies[2].pose_WB.position.x() = -2;
  world.Change(moved);
  CHECK(world.Position(1) == moved.bodies[1].pose_WB.position);
  CHECK(world.Velocity(1) == Vec3::Zero());
  CHECK(world.Position(2) == moved.bodies[2].pose_WB.position);
  CHECK(world.Body(0).generation == 1);
  CHECK(world.Body(1).generation == 2);
  CHECK(world.Body(2).generation == 2);
  for (std::uint32_t place = 0; place < 3; ++place) CHECK(world.Body(place).body == place);

  // Another mass: another thing, but it goes on.
  world.Push(world.Body(1), 500'000'000'000);
  world.Tick();
  const Vec3 velocity = world.Velocity(1);
  REQUIRE(velocity.x() > 0.1);
  Scene heavier = moved;
  heavier.bodies[1].mass_kg = 2;
  world.Change(heavier);
  CHECK(world.Velocity(1) == velocity);
  CHECK(world.Body(1).mass == 2);
  CHECK(world.Body(1).generation == 3);
}

TEST_CASE("a restart puts back what moves, and only that is another thing") {
  const Scene scene = WallAndCube();
  Running world(scene);
  world.Tick();
  world.Push(world.Body(1), 500'000'000'000);
  world.Tick();
  world.Change(scene, Replacement::kRestart);
  CHECK(world.Position(1) == scene.bodies[1].pose_WB.position);
  CHECK(world.Velocity(1) == Vec3::Zero());
  CHECK(world.Body(0).generation == 1);
  CHECK(world.Body(1).generation == 2);
  CHECK(world.Body(2).generation == 1);
}

TEST_CASE("what is gone comes back as another number, and no pair of names is given twice") {
  const Scene both = WallAndCube();
  Scene one = both;
  one.bodies.erase(one.bodies.begin() + 1);
  Running world(both);
  std::vector<std::pair<std::uint32_t, std::uint32_t>> cubes;
  for (int i = 0; i < 5; ++i) {
    cubes.emplace_back(world.Body(1).body, world.Body(1).generation);
    world.Change(one);
    CHECK(world.Body(1).body == 2);
    CHECK(world.Body(1).generation == 1);
    world.Change(both);
  }
  std::sort(cubes.begin(), cubes.end());
  CHECK(std::adjacent_find(cubes.begin(), cubes.end()) == cubes.end());
}

TEST_CASE("a push on what stays arrives, on what is gone it is declared discarded, to the unit") {
  const protocol::Coupling coupling =
      GENERATE(protocol::Coupling::kImpulse, protocol::Coupling::kLocal);
  Scene scene = WallAndCube();
  scene.gravity.setZero();
  scene.bodies[1].pose_WB.position.z() = 1;
  Running world(scene, coupling);
  world.Tick();
  Scene behind = scene;  // the cube gets another place in the scene
  behind.bodies.push_back(behind.bodies[1]);
  behind.bodies[1] = Named(test::Cube(0.04, 0.3, 0.3, {3, 0, 1}), "new::link");
  const protocol::Body cube = world.Body(1);
  world.Push(cube, 100'000'000'000);  // pending at the change
  world.Change(behind);
  world.Push(cube, 20'000'000'000);  // under way
  world.Tick();
  CHECK(world.Velocity(3).x() == Approx(0.12).epsilon(1e-12));
  CHECK(world.Velocity(1) == Vec3::Zero());
  CHECK(world.frame().applied == protocol::ImpulseUnits{120'000'000'000, 0, 0});
  CHECK(world.frame().discarded == protocol::ImpulseUnits{});

  Scene gone = behind;
  gone.bodies.pop_back();
  world.Push(cube, 3);
  world.Change(gone);
  world.Push(cube, 4);
  world.Tick();
  CHECK(world.frame().applied == protocol::ImpulseUnits{120'000'000'000, 0, 0});
  CHECK(world.frame().discarded == protocol::ImpulseUnits{7, 0, 0});
}

TEST_CASE("a stack does not jump when its engine is built anew") {
  const Scene scene = Stack();
  Running changed(scene);
  Running undisturbed(scene);
  for (Running* world : {&changed, &undisturbed}) {
    for (int i = 0; i < 20; ++i) world->Tick();
  }
  Scene more = scene;
  more.bodies.push_back(Named(test::Cube(0.06, 0.3, 0.3, {3, 0, 0.03}), "new::link"));
  changed.Change(more);
  changed.Tick();
  undisturbed.Tick();
  for (std::size_t i = 1; i <= 10; ++i) {
    CAPTURE(i);
    // The solver of a new engine starts without the last impulses: the contacts under a box give way
    // until they come back, ten together by no more than two resting depths.
    CHECK((changed.Position(i) - undisturbed.Position(i)).norm() <= 2e-5);
    CHECK(changed.Velocity(i).norm() <= 1e-3);
  }
}

}  // namespace rikiseki::world
