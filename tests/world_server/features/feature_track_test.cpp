// SPDX-License-Identifier: MIT
#include "world_server/features/feature_track.h"

#include <catch2/catch.hpp>
#include <set>

#include "tests/world_server/meshes.h"
#include "tests/world_server/scenes.h"
#include "world_server/features/near_bodies.h"

namespace rikiseki::world {
namespace {

Mesh UprightCorner() {
  const test::RawMesh raw =
      test::Prism({{0, 0}, {0, 0.2}, {-0.1, 0.2}, {-0.1, -0.1}, {0.3, -0.1}, {0.3, 0}}, 0.2);
  return {.mesh = std::make_shared<const TriangleMesh>(raw.corners, raw.triangles)};
}

}  // namespace

TEST_CASE("floor and wall of one mesh keep their numbers, whichever is nearer") {
  const Mesh corner = UprightCorner();
  FeatureTrack track;
  std::vector<NearestPoint> found;
  std::uint32_t floor_slot = 99, wall_slot = 99;
  // Along the floor towards the wall, up the wall, and back out.
  for (int i = 0; i < 60; ++i) {
    const double a = i / 59.0 * 3.14159265358979323846 / 2;
    const Vec3 p(0.005 + 0.04 * std::cos(a), 0.01, 0.005 + 0.04 * std::sin(a));
    track.Find(corner, p, 0.05, found);
    REQUIRE_FALSE(found.empty());
    const auto slots = track.Number(found, 0.05);
    for (std::size_t j = 0; j < found.size(); ++j) {
      std::uint32_t& slot = found[j].normal.z() > 0.5 ? floor_slot : wall_slot;
      if (slot == 99) slot = slots[j];
      CHECK(slots[j] == slot);
    }
  }
  CHECK(floor_slot == 0);
  CHECK(wall_slot == 1);
}

TEST_CASE("a number that has just gone is not given to another surface") {
  FeatureTrack track;
  const auto facing = [](const Vec3& normal) {
    NearestPoint feature;
    feature.normal = normal;
    return feature;
  };
  const std::vector<NearestPoint> up = {facing(Vec3::UnitZ())};
  const std::vector<NearestPoint> down = {facing(-Vec3::UnitZ())};
  CHECK(track.Number(up, 0.1)[0] == 0);
  CHECK(track.Number(down, 0.1)[0] == 1);
  CHECK(track.Number(up, 0.1)[0] == 0);
  // Round an edge it stays the same.
  CHECK(track.Number(std::vector{facing(Vec3::UnitX())}, 0.1)[0] == 0);
  std::vector<NearestPoint> many;
  for (std::size_t i = 0; i < kMaxFeatures; ++i) {
    many.push_back(facing(Vec3(1, 0.1 * static_cast<double>(i), 0).normalized()));
  }
  for (int frame = 0; frame < 5; ++frame) {
    for (NearestPoint& feature : many) feature.normal = -feature.normal;
    const auto slots = track.Number(many, 0.1);
    CHECK(std::set<std::uint32_t>(slots.begin(), slots.end()).size() == kMaxFeatures);
    for (const std::uint32_t slot : slots) CHECK(slot < FeatureTrack::kMaxSlots);
  }
}

TEST_CASE("in the middle of a shape the side felt before is kept") {
  const Box box{{0.01, 0.03, 0.03}};
  for (const double side : {-1.0, 1.0}) {
    FeatureTrack track;
    std::vector<NearestPoint> found;
    track.Find(box, Vec3(side * 0.002, 0, 0), 0.05, found);
    track.Number(found, 0.05);
    track.Find(box, Vec3::Zero(), 0.05, found);
    REQUIRE(found.size() == 1);
    CHECK(found[0].normal == side * Vec3::UnitX());
    CHECK(found[0].distance == Approx(-0.01).epsilon(1e-12));
    const Vec3 direction = Vec3(0.6, side * 0.8, 0);
    FeatureTrack of_ball;
    of_ball.Find(Sphere{0.03}, 0.01 * direction, 0.05, found);
    of_ball.Number(found, 0.05);
    of_ball.Find(Sphere{0.03}, Vec3::Zero(), 0.05, found);
    CHECK((found[0].normal - direction).norm() < 1e-9);
    CHECK((found[0].point - 0.03 * direction).norm() < 1e-9);
  }
}

TEST_CASE("near bodies: none is missing, with a tree and without, moving and fixed") {
  for (const int count : {10, 500}) {
    Scene scene;
    scene.bodies.push_back(test::Floor(0.3));
    std::srand(1);
    for (int i = 0; i < count; ++i) {
      scene.bodies.push_back(test::Cube(0.05, 0.1, 0.3, Vec3::Random()));
      scene.bodies.back().fixed = i % 3 != 0;
    }
    std::vector<BodyState> states;
    for (const SceneBody& body : scene.bodies) states.push_back({.pose = body.pose_WB});
    for (std::size_t i = 1; i < states.size(); i += 3) {
      states[i].velocity = Vec3::Random();
      states[i].angular_velocity = 10 * Vec3::Random();
    }
    const NearBodies near(scene);
    const double half_diagonal = 0.05 * std::sqrt(3.0) / 2;  // of a cube, its outer ball
    std::vector<std::size_t> found;
    for (int probe = 0; probe < 50; ++probe) {
      const Vec3 p = Vec3::Random();
      near.Find(states, p, 0.1, 0.1, found);
      CHECK(std::is_sorted(found.begin(), found.end()));
      for (std::size_t body = 0; body < scene.bodies.size(); ++body) {
        const auto& shape = scene.bodies[body].colliders[0].shape;
        const double distance = FindNearestPoint(shape, states[body].pose.Inverse() * p).distance;
        const double way = scene.bodies[body].fixed
                               ? 0
                               : 0.1 * (states[body].velocity.norm() +
                                        states[body].angular_velocity.norm() * half_diagonal);
        const bool is_found = std::binary_search(found.begin(), found.end(), body);
        if (distance <= 0.1 + way) REQUIRE(is_found);
        if (body > 0 && distance > 0.2 + way) REQUIRE_FALSE(is_found);
      }
    }
  }
}

TEST_CASE("a half-space may be what moves: it is everywhere, and as near as its face") {
  Scene scene;
  scene.bodies.push_back(test::Cube(0.05, 0.1, 0.3, Vec3::Zero()));
  scene.bodies[0].colliders[0].shape = HalfSpace{.normal = Vec3::UnitZ()};
  const NearBodies near(scene);
  const BodyState state{.velocity = Vec3(3, 0, 4)};
  CHECK(near.WayOf(0, state, 0.1) == Approx(0.5));
  std::vector<std::size_t> found;
  near.Find(std::span(&state, 1), Vec3(1e6, 0, 0), 0.1, 0.1, found);
  CHECK(found.size() == 1);
}

}  // namespace rikiseki::world
