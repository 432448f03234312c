// SPDX-License-Identifier: MIT
#include "world_server/features/planes.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "tests/world_server/jointed_scenes.h"

namespace rikiseki::world {
namespace {

using test::CubeOnFloor;

struct Found {
  std::array<protocol::Plane, protocol::kMaxPlanes> planes{};
  std::uint32_t count = 0;
};

Found Find(const Scene& scene, const std::vector<Finger>& fingers, const FeatureReach& reach) {
  std::vector<BodyState> states;
  std::vector<std::uint32_t> generations;
  for (const SceneBody& body : scene.bodies) {
    states.push_back({.pose = body.pose_WB});
    generations.push_back(7);
  }
  Found found;
  found.count = PlaneFinder(scene).Find(states, generations, fingers, reach, found.planes);
  return found;
}

}  // namespace

TEST_CASE("planes are tangent at the nearest points, nearest first") {
  Scene scene = CubeOnFloor(0.3);
  scene.bodies[1].colliders[0].stiffness_n_per_m = 800;
  scene.bodies[1].colliders[0].damping_ns_per_m = 3;
  // 25 mm from the face (15 from the sphere), 30 mm from the floor (20 from the sphere).
  const Finger finger{.pointer = 2, .radius_m = 0.01, .position = {-0.055, 0, 0.03}};
  const Found found = Find(scene, {finger}, {.radius_m = 0.0201, .period_s = 0.05});
  REQUIRE(found.count == 2);
  CHECK(found.planes[0].body == 1);
  CHECK(found.planes[0].generation == 7);
  CHECK(found.planes[0].pointer == 2);
  CHECK(ToVec3(found.planes[0].normal) == Vec3(-1, 0, 0));
  CHECK((ToVec3(found.planes[0].point) - Vec3(-0.03, 0, 0.03)).norm() < 1e-15);
  CHECK(found.planes[0].stiffness == 800);
  CHECK(found.planes[0].damping == 3);
  CHECK(found.planes[1].body == 0);
  CHECK(found.planes[1].stiffness == 0);
  CHECK(ToVec3(found.planes[1].normal) == Vec3(0, 0, 1));
}

TEST_CASE("a ball says its radius, a flat surface none") {
  Scene scene = CubeOnFloor(0.3);
  scene.bodies[1].colliders[0].shape = Sphere{0.03};
  const Found found = Find(scene, {{.radius_m = 0.01, .position = {-0.055, 0, 0.03}}},
                           {.radius_m = 0.05, .period_s = 0.05});
  REQUIRE(found.count == 2);
  CHECK(found.planes[0].body == 1);
  CHECK(found.planes[0].radius == 0.03);
  CHECK(found.planes[1].radius == 0);
}

TEST_CASE("the radius grows by the way of two periods at the relative speed") {
  const Scene scene = CubeOnFloor(0.3);
  Finger finger{.radius_m = 0.01, .position = {-0.5, 0, 0.5}};  // 0.49 m above the floor
  const FeatureReach reach{.radius_m = 0.02, .period_s = 0.05};
  CHECK(Find(scene, {finger}, reach).count == 0);
  finger.velocity = {0, 0, -4.8};  // 0.02 + 2 * 0.05 * 4.8 = 0.5 >= 0.49
  CHECK(Find(scene, {finger}, reach).count >= 1);
  finger.velocity = {0, 0, -4.6};
  CHECK(Find(scene, {finger}, reach).count == 0);

  // The body's own velocity counts as well, its rotation included.
  std::vector<BodyState> states = {{}, {.pose = {.position = {0.5, 0, 0.03}}}};
  states[1].angular_velocity = {0, 0, 160};
  const std::vector<std::uint32_t> generations = {1, 1};
  std::array<protocol::Plane, 4> planes;
  finger = {.radius_m = 0.01, .position = {0.0, 0.03, 0.5}};
  CHECK(PlaneFinder(scene).Find(states, generations, std::vector{finger}, reach, planes) == 1);
}

TEST_CASE("the material's velocity is sent, and friction where finger and surface have it") {
  Scene scene = CubeOnFloor(0.4);
  scene.bodies[0].colliders[0].friction = 0;  // ice
  scene.bodies[1].colliders[0].static_friction = 0.9;
  scene.bodies[1].colliders[0].recovery_s = 0.25;
  std::vector<BodyState> states = {{}, {.pose = {.position = {0, 0, 0.03}}}};
  states[1].velocity = {0.1, 0, 0};
  states[1].angular_velocity = {0, 0, 2};
  const std::vector<std::uint32_t> generations = {1, 1};
  std::array<protocol::Plane, 4> planes;
  Finger finger{.radius_m = 0.01, .position = {-0.04, 0.01, 0.03}};
  const FeatureReach reach{.radius_m = 0.1, .period_s = 0.05};

  REQUIRE(PlaneFinder(scene).Find(states, generations, std::vector{finger}, reach, planes) == 2);
  for (int i = 0; i < 2; ++i) {
    CHECK(planes[static_cast<std::size_t>(i)].static_friction == 0);
    CHECK(planes[static_cast<std::size_t>(i)].dynamic_friction == 0);
  }
  CHECK(planes[0].recovery_s == 0.25);

  finger.friction = 0.1;
  REQUIRE(PlaneFinder(scene).Find(states, generations, std::vector{finger}, reach, planes) == 2);
  REQUIRE(planes[0].body == 1);
  CHECK(planes[0].dynamic_friction == Approx(0.2));  // sqrt(0.1 0.4)
  CHECK(planes[0].static_friction == Approx(0.3));   // sqrt(0.1 0.9)
  // v + w x r at (-0.03, 0.01, 0.03): (0.1, 0, 0) + 2 z x (-0.03, 0.01, 0)
  CHECK((ToVec3(planes[0].velocity) - Vec3(0.08, -0.06, 0)).norm() < 1e-15);
  CHECK(planes[1].body == 0);
  CHECK(planes[1].dynamic_friction == 0);
  CHECK(planes[1].recovery_s == 0);

  scene.bodies[1].colliders[0].static_friction.reset();
  PlaneFinder(scene).Find(states, generations, std::vector{finger}, reach, planes);
  CHECK(planes[0].static_friction == planes[0].dynamic_friction);
}

TEST_CASE("what is jointed yields as its joint lets it") {
  // The face of a door, at 0.7 m from the hinge: I / r^2. At its edge, towards the hinge: nothing.
  Scene scene = test::Door();
  const FeatureReach reach{.radius_m = 0.1, .period_s = 0.05};
  const auto yields = [&](const Vec3& place) {
    const Found found = Find(scene, {{.radius_m = 0.01, .position = place}}, reach);
    REQUIRE(found.count == 1);
    return found.planes[0].inverse_mass;
  };
  CHECK(yields({0.7, -0.05, 1.6}) == Approx(0.49 / test::kDoorInertia).epsilon(1e-9));
  CHECK(yields({0.85, 0, 1}) == Approx(0).margin(1e-12));
  // Closed against a stop it yields to one side only.
  scene.joints[0].upper = 0;
  CHECK(yields({0.7, -0.05, 1.6}) == Approx(0).margin(1e-12));
  CHECK(yields({0.7, 0.05, 1.6}) == Approx(0.49 / test::kDoorInertia).epsilon(1e-9));
}

TEST_CASE("every pointer and every collider has its own plane, and the nearest 32 are sent") {
  Scene scene;
  SceneBody body = test::Floor(1);
  body.colliders.clear();
  for (int i = 0; i < 20; ++i) {
    Collider ball{.shape = Sphere{0.01}};
    ball.pose_BS.position = {0.1 * (20 - i), 0, 0};
    body.colliders.push_back(ball);
  }
  scene.bodies = {body};
  const std::vector<Finger> fingers = {{.pointer = 0}, {.pointer = 3, .position = {0, 0.5, 0}}};
  const Found found = Find(scene, fingers, {.radius_m = 10, .period_s = 0.05});
  REQUIRE(found.count == protocol::kMaxPlanes);
  CHECK(found.planes[0].feature == 19);  // the nearest ball is the last collider
  CHECK(found.planes[0].pointer == 0);
  double last = 0;
  for (std::uint32_t i = 0; i < found.count; ++i) {
    const protocol::Plane& plane = found.planes[i];
    const double gap = (fingers[plane.pointer == 0 ? 0 : 1].position - ToVec3(plane.point)).norm();
    CHECK(gap >= last - 1e-12);
    last = gap;
  }
}

TEST_CASE("fingers that cannot be computed with are left out") {
  protocol::HapticTick tick;
  tick.pointer_count = 4'000'000'000U;
  tick.pointers[0].pointer = 0;
  tick.pointers[0].position = {0, std::numeric_limits<double>::quiet_NaN(), 0};
  tick.pointers[1].pointer = 1;
  tick.pointers[1].radius = -1;
  tick.pointers[2].pointer = 2;
  tick.pointers[2].position = {1e8, 0, 0};
  tick.pointers[3].pointer = 2;
  const std::vector<Finger> fingers = FingersOf(tick);
  REQUIRE(fingers.size() == 1);
  CHECK(fingers[0].pointer == 2);
  CHECK(fingers[0].position.x() == 1e8);
  tick.pointers[2].velocity = {0, 0, std::numeric_limits<double>::infinity()};
  tick.pointers[3].pointer = 9;
  CHECK(FingersOf(tick).empty());
}

}  // namespace rikiseki::world
