// SPDX-License-Identifier: MIT
#include "haptic_server/render/surface_motion.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

namespace rikiseki::haptic {
namespace {

Surface At(const Vec3& point, const Vec3& normal, std::uint32_t body = 1,
           std::uint32_t feature = 0) {
  Surface surface;
  surface.body = body;
  surface.feature = feature;
  surface.plane = {point, normal.normalized()};
  return surface;
}

// What they did with `force`, when they moved from `before` to `now`.
double Work(const Vec3& finger, const std::vector<Surface>& before, const std::vector<Surface>& now,
            const Vec3& force, double elapsed_s = 1e-3) {
  std::vector<HalfSpace> planes;
  for (const Surface& surface : before) planes.push_back(surface.plane);
  SurfaceMotion motion;
  motion.Remember(before, SolveContact(finger, 0.01, planes));
  return motion.Work(now, force, elapsed_s).all;
}

const Vec3 kFinger(0.008, 0.003, 0);  // 2 mm deep in a floor at x = 0 that faces +x

TEST_CASE("a floor that lifts the finger does force times way, one that slides under it nothing") {
  const std::vector<Surface> floor = {At(Vec3::Zero(), Vec3::UnitX())};
  const Vec3 force(4, 0, 0);
  CHECK(Work(kFinger, floor, floor, force) == 0);
  CHECK(Work(kFinger, floor, {At(Vec3(0.0003, 0, 0), Vec3::UnitX())}, force) ==
        Approx(4 * 0.0003).epsilon(1e-12));
  CHECK(std::abs(Work(kFinger, floor, {At(Vec3(0, 0.5, -2), Vec3::UnitX())}, force)) < 1e-15);
  // Tilted about the contact, it does not lift.
  CHECK(std::abs(Work(kFinger, floor, {At(Vec3(0, 0.003, 0), Vec3(1, 1e-4, 0))}, force)) < 1e-9);
  // Tilted about a place 0.1 m away, it does.
  CHECK(Work(kFinger, floor, {At(Vec3(0, -0.097, 0), Vec3(1, -1e-4, 0))}, force) ==
        Approx(4 * 1e-4 * 0.1).epsilon(1e-3));
}

TEST_CASE("a corner that moves as one does force times way, in any order of its planes") {
  const Vec3 finger(0.006, 0.007, 0.02);
  const Vec3 way(2e-4, -1e-4, 5e-4);
  std::vector<Surface> before = {At(Vec3::Zero(), Vec3(1, 0.3, 0), 1, 0),
                                 At(Vec3::Zero(), Vec3(0.2, 1, 0), 1, 1)};
  std::vector<HalfSpace> planes = {before[0].plane, before[1].plane};
  const Vec3 force = 2000 * SolveContact(finger, 0.01, planes).displacement;
  REQUIRE(force.norm() > 1);
  const std::vector<Surface> now = {At(way, before[1].plane.normal, 1, 1),
                                    At(way, before[0].plane.normal, 1, 0)};
  CHECK(Work(finger, before, now, force) == Approx(force.dot(way)).epsilon(1e-9));
}

TEST_CASE("what is no normal force works along with the body's material") {
  std::vector<Surface> floor = {At(Vec3::Zero(), Vec3::UnitX())};
  floor[0].velocity = Vec3(0, 0.2, 0);
  const Vec3 friction(0, 1.5, 0);
  CHECK(Work(kFinger, floor, floor, Vec3(4, 0, 0) + friction, 2e-3) ==
        Approx(1.5 * 0.2 * 2e-3).epsilon(1e-12));
  CHECK(std::abs(Work(kFinger, floor, floor, Vec3(4, 0, 0), 2e-3)) < 1e-15);
}

TEST_CASE("a ball at rest does nothing to a finger that slides round it, one that moves does") {
  const auto ball = [](const Vec3& centre, double angle) {
    const Vec3 normal(std::cos(angle), std::sin(angle), 0);
    Surface surface = At(centre + 0.03 * normal, normal);
    surface.radius = 0.03;
    return surface;
  };
  const Vec3 finger(0.038, 0, 0);
  CHECK(std::abs(Work(finger, {ball(Vec3::Zero(), 0)}, {ball(Vec3::Zero(), 0.01)}, Vec3(4, 0, 0))) <
        1e-15);
  CHECK(Work(finger, {ball(Vec3::Zero(), 0)}, {ball(Vec3(1e-4, 0, 0), 0.01)}, Vec3(4, 0, 0)) ==
        Approx(4e-4).epsilon(1e-9));
}

TEST_CASE("bodies that can move and have no copy are counted apart") {
  std::vector<Surface> wedge = {At(Vec3::Zero(), Vec3::UnitX(), 1),
                                At(Vec3::Zero(), Vec3::UnitY(), 2)};
  std::vector<Surface> moved = wedge;
  for (Surface& surface : moved) surface.plane.point += 1e-4 * surface.plane.normal;
  moved[1].copied = true;
  SurfaceMotion motion;
  const std::vector<HalfSpace> planes = {wedge[0].plane, wedge[1].plane};
  motion.Remember(wedge, SolveContact(Vec3(0.008, 0.007, 0), 0.01, planes));
  const SurfaceMotion::WorkDone done = motion.Work(moved, Vec3(4, 6, 0), 1e-3);
  CHECK(done.all == Approx(1e-3).epsilon(1e-12));
  CHECK(done.split == Approx(4e-4).epsilon(1e-12));
}

TEST_CASE("surfaces that went, and a finger that is free, do nothing") {
  const std::vector<Surface> floor = {At(Vec3::Zero(), Vec3::UnitX())};
  CHECK(Work(kFinger, floor, {}, Vec3(4, 0, 0)) == 0);
  CHECK(Work(kFinger, floor, {At(Vec3(0.001, 0, 0), Vec3::UnitX(), 2)}, Vec3(4, 0, 0)) == 0);
  CHECK(Work(Vec3(0.02, 0, 0), floor, {At(Vec3(0.001, 0, 0), Vec3::UnitX())}, Vec3(4, 0, 0)) == 0);
}

}  // namespace
}  // namespace rikiseki::haptic
