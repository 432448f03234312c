// SPDX-License-Identifier: MIT
#include "world_server/features/local_bodies.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <map>
#include <set>
#include <stdexcept>
#include <utility>

#include "tests/world_server/scenes.h"
#include "world_server/physics/bullet_world.h"

namespace rikiseki::world {
namespace {

using test::Cube;
using test::Floor;

constexpr double kReach = 0.02;

Scene OnFloor(const std::vector<SceneBody>& bodies) {
  Scene scene;
  scene.bodies = {Floor(0.3)};
  scene.bodies.insert(scene.bodies.end(), bodies.begin(), bodies.end());
  return scene;
}

SceneBody CubeAt(double x, double mass_kg = 1, double z = 0.03) {
  return Cube(0.06, mass_kg, 0.3, {x, 0, z});
}

struct Found {
  std::array<protocol::LocalBody, protocol::kMaxLocalBodies> bodies{};
  std::uint32_t count = 0;

  std::set<std::uint32_t> Names() const {
    std::set<std::uint32_t> names;
    for (std::uint32_t i = 0; i < count; ++i) names.insert(bodies[i].body);
    return names;
  }
  const protocol::LocalBody& Of(std::uint32_t body) const {
    for (std::uint32_t i = 0; i < count; ++i) {
      if (bodies[i].body == body) return bodies[i];
    }
    throw std::runtime_error("not found");
  }
  int Contacts(std::uint32_t body, std::uint32_t other) const {
    const protocol::LocalBody& local = Of(body);
    int contacts = 0;
    for (std::uint32_t i = 0; i < local.contact_count; ++i) {
      contacts += local.contacts[i].other_body == other ? 1 : 0;
    }
    return contacts;
  }
};

// With the finger near these bodies, the nearest first.
Found Find(const Scene& scene, const std::vector<std::uint32_t>& near,
           const std::map<std::size_t, Vec3>& velocities = {}) {
  BulletWorld world(scene, 1e-3);
  std::vector<BodyState> states;
  std::vector<std::uint32_t> generations;
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
    states.push_back({.pose = scene.bodies[i].pose_WB});
    generations.push_back(static_cast<std::uint32_t>(10 + i));
  }
  for (const auto& [body, velocity] : velocities) states[body].velocity = velocity;
  std::vector<protocol::Plane> planes(near.size());
  for (std::size_t i = 0; i < near.size(); ++i) planes[i].body = near[i];
  Found found;
  found.count = FindLocalBodies(scene, world, states, generations, planes,
                                {.radius_m = kReach, .period_s = 0.05}, found.bodies);
  return found;
}

}  // namespace

TEST_CASE("the touched body, with its mass, its state and all it stands on") {
  Scene scene = OnFloor({CubeAt(0), CubeAt(1)});
  scene.bodies[1].inertia << 3e-4, 1e-5, 2e-5, 1e-5, 4e-4, 3e-5, 2e-5, 3e-5, 5e-4;
  const Found found = Find(scene, {0, 1}, {{1, Vec3(0.1, 0, 0)}});
  REQUIRE(found.count == 1);
  const protocol::LocalBody& local = found.bodies[0];
  CHECK(local.body == 1);
  CHECK(local.generation == 11);
  CHECK(local.mass == 1);
  CHECK(local.inertia == std::array<double, 6>{3e-4, 1e-5, 2e-5, 4e-4, 3e-5, 5e-4});
  CHECK(local.position == std::array<double, 3>{0, 0, 0.03});
  CHECK(local.velocity == std::array<double, 3>{0.1, 0, 0});
  CHECK(local.acceleration == std::array<double, 3>{0, 0, -9.81});
  REQUIRE(local.contact_count == 4);
  for (std::uint32_t i = 0; i < 4; ++i) {
    const protocol::ContactPlane& contact = local.contacts[i];
    CHECK(contact.other_body == 0);
    CHECK(contact.other_generation == 10);
    CHECK(contact.normal == std::array<double, 3>{0, 0, 1});
    CHECK(contact.friction == Approx(0.3));
    // Zero, less the depth at which the engine lets it rest: 1e-4 of the diagonal.
    CHECK(contact.gap == Approx(1e-4 * 0.06 * std::sqrt(3)).epsilon(1e-9));
    CHECK(contact.point[2] == Approx(-0.03));
  }
}

TEST_CASE("nothing moves, or nothing is near: no copies") {
  CHECK(Find(OnFloor({CubeAt(0)}), {0}).count == 0);
  CHECK(Find(OnFloor({CubeAt(0)}), {}).count == 0);
}

TEST_CASE("a body that the finger touches twice has one copy") {
  CHECK(Find(OnFloor({CubeAt(0)}), {1, 1}).count == 1);
}

TEST_CASE("neighbours come along, their contact told once, by the lower number") {
  for (const std::uint32_t touched : {1, 2}) {
    const Found found = Find(OnFloor({CubeAt(0), CubeAt(0.065), CubeAt(0.3)}), {touched});
    CHECK(found.Names() == std::set<std::uint32_t>{1, 2});
    CHECK(found.bodies[0].body == touched);
    CHECK(found.Contacts(1, 2) == 4);
    CHECK(found.Contacts(2, 1) == 0);
    CHECK(found.Contacts(1, 0) == 4);
    CHECK(found.Contacts(2, 0) == 4);
  }
}

TEST_CASE("reach grows with speed, and a contact that one of two sees is not lost") {
  const Scene scene = OnFloor({CubeAt(0), CubeAt(0.11)});  // 50 mm apart
  CHECK(Find(scene, {1}).Names() == std::set<std::uint32_t>{1});
  const Found fast = Find(scene, {1}, {{1, Vec3(0.4, 0, 0)}});
  CHECK(fast.Names() == std::set<std::uint32_t>{1, 2});
  CHECK(fast.Contacts(1, 2) == 4);
  // The one of the higher number is fast: only its list has the other.
  const Found back = Find(scene, {2}, {{2, Vec3(-0.4, 0, 0)}});
  CHECK(back.Names() == std::set<std::uint32_t>{1, 2});
  CHECK(back.Contacts(1, 2) + back.Contacts(2, 1) == 4);
}

TEST_CASE("a chain of four has copies, and of five that touch none, unless the fifth is heavy") {
  const auto chain = [](int n, double last_kg, double way = 0.0605) {
    std::vector<SceneBody> bodies;
    for (int i = 0; i < n; ++i) bodies.push_back(CubeAt(way * i, i == n - 1 ? last_kg : 1));
    return OnFloor(bodies);
  };
  CHECK(Find(chain(4, 1), {1}).count == 4);
  CHECK(Find(chain(5, 1), {1}).count == 0);
  CHECK(Find(chain(5, 9.9), {1}).count == 0);
  const Found heavy = Find(chain(5, 10), {1});
  CHECK(heavy.Names() == std::set<std::uint32_t>{1, 2, 3, 4});
  CHECK(heavy.Contacts(4, 5) == 4);  // as a plane
  const Found apart = Find(chain(5, 1, 0.065), {1});
  CHECK(apart.Names() == std::set<std::uint32_t>{1, 2, 3, 4});
  CHECK(apart.Contacts(4, 5) == 4);
}

TEST_CASE("a body that gets none leaves the room to others") {
  // Bodies 1..5 in a chain, and 6 by itself.
  std::vector<SceneBody> bodies;
  for (int i = 0; i < 5; ++i) bodies.push_back(CubeAt(0.0605 * i));
  bodies.push_back(CubeAt(3));
  const Found found = Find(OnFloor(bodies), {1, 6});
  CHECK(found.Names() == std::set<std::uint32_t>{6});
}

TEST_CASE("a neighbour that bounces means no copy") {
  Scene scene = OnFloor({CubeAt(0), CubeAt(0.065)});
  scene.bodies[1].colliders[0].restitution = scene.bodies[2].colliders[0].restitution = 0.5;
  CHECK(Find(scene, {1}).count == 0);
  CHECK(Find(scene, {2}).count == 0);
  scene.bodies[2].mass_kg = 100;  // heavy, but a plane does not throw it back
  CHECK(Find(scene, {1}).count == 0);
}

TEST_CASE("a copy has contacts whatever its shape and its neighbour's") {
  for (const Shape& shape : {Shape(Cylinder{0.03, 0.03}), Shape(Capsule{0.02, 0.01}),
                             Shape(Ellipsoid{{0.03, 0.03, 0.03}})}) {
    Scene scene = OnFloor({CubeAt(0), CubeAt(0.065)});
    scene.bodies[2].colliders[0].shape = shape;
    CAPTURE(shape.index());
    CHECK(Find(scene, {1}).Names() == std::set<std::uint32_t>{1, 2});
    const Found found = Find(scene, {2});
    CHECK(found.Names() == std::set<std::uint32_t>{1, 2});
    CHECK(found.Contacts(1, 2) >= 1);
    CHECK(found.Contacts(2, 0) >= 1);
  }
}

TEST_CASE("of more contacts than a copy can have it has the nearest") {
  // A cube on the floor with cubes close by on all sides and on top: more than 16 points.
  Scene scene = OnFloor({CubeAt(0)});
  for (const Vec3& at :
       {Vec3(0.061, 0, 0.03), Vec3(-0.061, 0, 0.03), Vec3(0, 0.061, 0.03), Vec3(0, -0.061, 0.03)}) {
    SceneBody wall = Cube(0.06, 1, 0.3, at);
    wall.fixed = true;
    scene.bodies.push_back(wall);
  }
  const Found found = Find(scene, {1});
  REQUIRE(found.count == 1);
  CHECK(found.bodies[0].contact_count == protocol::kMaxContactPlanes);
  CHECK(found.Contacts(1, 0) == 4);  // what it stands on
}

}  // namespace rikiseki::world
