// SPDX-License-Identifier: MIT
// Round shapes that roll and shapes that stand on each other, in the engine, against closed forms.
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "tests/world_server/meshes.h"
#include "tests/world_server/scenes.h"
#include "world_server/geometry/convex_hull.h"
#include "world_server/physics/bullet_world.h"
#include "world_server/scene/shape_size.h"

namespace rikiseki::world {
namespace {

constexpr double kSubstep = 1e-3;
constexpr double kGravity = 9.81;
const Quat kLying(Eigen::AngleAxisd(std::numbers::pi / 2, Vec3::UnitX()));

Hull Pillar(double radius, double half_length, int sides) {
  std::vector<Vec3> corners;
  for (int i = 0; i < sides; ++i) {
    const double angle = 2 * std::numbers::pi * i / sides;
    for (const double side : {-1.0, 1.0}) {
      corners.emplace_back(radius * std::cos(angle), radius * std::sin(angle), side * half_length);
    }
  }
  return {.mesh = std::make_shared<const TriangleMesh>(ConvexHull(corners))};
}

Vec3 OfCylinder(double radius, double half_length) {
  const double across = (3 * radius * radius + 4 * half_length * half_length) / 12;
  return {across, across, radius * radius / 2};
}

SceneBody Solidly(const Shape& shape, double mass_kg, const Vec3& moments, const Pose& pose) {
  SceneBody body = test::Cube(0.06, mass_kg, 0.5, Vec3::Zero());
  body.inertia = Vec3(mass_kg * moments).asDiagonal();
  body.colliders[0].shape = shape;
  body.pose_WB = pose;
  return body;
}

void Run(BulletWorld& world, double seconds) {
  for (int i = 0; i < std::lround(seconds / 0.01); ++i) world.ApplyAndStep({}, 0.01);
}

}  // namespace

TEST_CASE("what rolls down a slope without slipping has a = g sin / (1 + I / m r^2)") {
  constexpr double kRadius = 0.03;
  constexpr double kSlope = 0.2;  // rad: mu 0.5 is more than enough
  const double square = kRadius * kRadius;
  // About the axis that it rolls about; a capsule's from its parts.
  const double tube = 0.04 / (0.04 + 4 * kRadius / 3);
  const double capsule = tube * square / 2 + (1 - tube) * 0.4 * square;
  struct Roller {
    Shape shape;
    Quat orientation;
    double moment;  // m^2
  };
  const std::vector<Roller> rollers = {
      {Sphere{kRadius}, Quat::Identity(), 0.4 * square},
      {Cylinder{kRadius, 0.04}, kLying, square / 2},
      {Capsule{kRadius, 0.02}, kLying, capsule},
      {Ellipsoid{{kRadius, 0.05, kRadius}}, Quat::Identity(), 0.4 * square}};
  for (const Roller& roller : rollers) {
    for (const bool on_box : {false, true}) {
      Scene scene = test::CubeOnFloor(0.5);
      scene.gravity = {kGravity * std::sin(kSlope), 0, -kGravity * std::cos(kSlope)};
      if (on_box) {
        scene.bodies[0].colliders[0].shape = Box{{2, 2, 0.05}};
        scene.bodies[0].colliders[0].pose_BS.position.z() = -0.05;
      }
      Vec3 moments = Vec3::Constant(roller.moment);
      if (std::holds_alternative<Cylinder>(roller.shape)) moments = OfCylinder(kRadius, 0.04);
      if (std::holds_alternative<Capsule>(roller.shape)) moments.head<2>() *= 2;
      scene.bodies[1] = Solidly(roller.shape, 1, moments, {{0, 0, kRadius}, roller.orientation});
      BulletWorld world(scene, kSubstep);
      Run(world, 1);
      const double exact = kGravity * std::sin(kSlope) / (1 + roller.moment / square);
      const BodyState state = world.State(1);
      CAPTURE(roller.shape.index(), on_box, state.pose.position.transpose(), exact);
      CHECK(state.velocity.x() == Approx(exact).epsilon(1e-3));
      // The slip of the first substeps, before it has sunk in by its slop of 1e-5 m.
      CHECK(state.pose.position.x() == Approx(exact / 2).epsilon(2e-3));
      CHECK(state.angular_velocity.y() == Approx(exact / kRadius).epsilon(1e-3));
      CHECK(std::abs(state.pose.position.y()) < 1e-5);
      CHECK(state.pose.position.z() == Approx(kRadius).margin(2e-5));
    }
  }
}

TEST_CASE("cylinders and hulls stand on each other at their heights, and stay") {
  constexpr double kRadius = 0.03;
  constexpr double kHalf = 0.02;
  const std::vector<Shape> shapes = {Cylinder{kRadius, kHalf}, Pillar(kRadius, kHalf, 8),
                                     Pillar(kRadius, kHalf, 24)};
  for (const Shape& below : shapes) {
    for (const Shape& above : shapes) {
      for (const double offset : {0.0, 0.01}) {
        Scene scene = test::CubeOnFloor(0.5);
        const Vec3 moments = OfCylinder(kRadius, kHalf);
        scene.bodies[1] = Solidly(below, 0.5, moments, {.position = {0, 0, kHalf}});
        const Quat turned(Eigen::AngleAxisd(0.3, Vec3::UnitZ()));
        scene.bodies.push_back(Solidly(above, 0.5, moments, {{offset, 0, 3 * kHalf}, turned}));
        BulletWorld world(scene, kSubstep);
        Run(world, 1);
        const Vec3 low = world.State(1).pose.position;
        const BodyState rests = world.State(2);
        Run(world, 3);
        const BodyState state = world.State(2);
        const double slop = 1e-4 * 2 * std::hypot(kRadius, kHalf);
        CAPTURE(below.index(), above.index(), offset, state.pose.position.transpose(),
                (state.pose.position - rests.pose.position).norm());
        CHECK(std::abs(state.pose.position.z() - 3 * kHalf) <= 2.1 * slop);
        // As boxes: the solver's 50 sweeps leave some um/s between points that share a load.
        CHECK((state.pose.position - rests.pose.position).norm() < 1.5e-5);
        CHECK((world.State(1).pose.position - low).norm() < 1.5e-5);
        CHECK(state.pose.orientation.angularDistance(rests.pose.orientation) < 2e-4);
        CHECK(state.velocity.norm() < 2e-5);
      }
    }
  }
}

TEST_CASE("an ellipsoid on a plane and on a box comes to lie on its flattest side") {
  const Vec3 radii(0.03, 0.04, 0.02);
  const Vec3 squares = radii.cwiseAbs2();
  const Vec3 moments = (Vec3::Constant(squares.sum()) - squares) / 5;
  for (const bool on_box : {false, true}) {
    Scene scene = test::CubeOnFloor(0.5);
    if (on_box) {
      scene.bodies[0].colliders[0].shape = Box{{2, 2, 0.05}};
      scene.bodies[0].colliders[0].pose_BS.position.z() = -0.05;
    }
    const Quat tilted(Eigen::AngleAxisd(0.1, Vec3(1, 1, 0).normalized()));
    scene.bodies[1] = Solidly(Ellipsoid{radii}, 0.2, moments, {{0, 0, 0.0203}, tilted});
    scene.bodies[1].angular_drag_nms = 2e-4;
    BulletWorld world(scene, kSubstep);
    double lowest = 1;
    for (int i = 0; i < 400; ++i) {
      world.ApplyAndStep({}, 0.01);
      lowest = std::min(lowest, world.State(1).pose.position.z());
    }
    CAPTURE(on_box, world.State(1).pose.position.transpose());
    CHECK(world.State(1).pose.position.z() == Approx(radii.z()).margin(2e-5));
    CHECK(lowest > radii.z() - 2e-5);
  }
}

}  // namespace rikiseki::world
