// SPDX-License-Identifier: MIT
// Cylinders and hulls on half-spaces and boxes in the engine, against closed forms.
#include <catch2/catch.hpp>
#include <cmath>

#include "tests/world_server/meshes.h"
#include "tests/world_server/scenes.h"
#include "world_server/geometry/convex_hull.h"
#include "world_server/physics/bullet_world.h"
#include "world_server/scene/shape_size.h"

namespace rikiseki::world {
namespace {

constexpr double kSubstep = 1e-3;
constexpr double kGravity = 9.81;

enum class Ground { kPlane, kBox };

Hull BoxHull(const Vec3& half) {
  return {.mesh = std::make_shared<const TriangleMesh>(
              ConvexHull(test::Build(test::BoxMesh(half)).corners()))};
}

// As a many-sided pillar: a hull whose faces have more corners than a contact keeps.
Hull PillarHull(double radius, double half_length) {
  std::vector<Vec3> corners;
  for (int i = 0; i < 24; ++i) {
    const double angle = 2 * M_PI * i / 24;
    for (const double side : {-1.0, 1.0}) {
      corners.emplace_back(radius * std::cos(angle), radius * std::sin(angle), side * half_length);
    }
  }
  return {.mesh = std::make_shared<const TriangleMesh>(ConvexHull(corners))};
}

// Body 0: a half-space, or a box of 4 x 4 x 0.1 m; the top of either is z = 0. Body 1: the shape, of
// 1 kg, with the inertia of a cylinder along z.
Scene OnGround(Ground ground, const Shape& shape, double radius, double half_length,
               double friction, const Pose& pose) {
  Scene scene = test::CubeOnFloor(friction);
  if (ground == Ground::kBox) {
    scene.bodies[0].colliders[0].shape = Box{{2, 2, 0.05}};
    scene.bodies[0].colliders[0].pose_BS.position.z() = -0.05;
  }
  SceneBody& body = scene.bodies[1];
  const double across = (3 * radius * radius + 4 * half_length * half_length) / 12;
  body.inertia = Vec3(across, across, radius * radius / 2).asDiagonal();
  body.colliders[0].shape = shape;
  body.pose_WB = pose;
  return scene;
}

Scene StandingCylinder(Ground ground, double radius, double half_length, double friction) {
  return OnGround(ground, Cylinder{radius, half_length}, radius, half_length, friction,
                  {{0, 0, half_length}, Quat::Identity()});
}

void Run(BulletWorld& world, double seconds, double period = 0.01) {
  const int periods = static_cast<int>(std::lround(seconds / period));
  for (int i = 0; i < periods; ++i) world.ApplyAndStep({}, period);
}

void Push(BulletWorld& world, const Vec3& impulse, const Vec3& angular = Vec3::Zero()) {
  const Kick kick{.body = 1, .impulse = impulse, .angular_impulse = angular};
  world.ApplyAndStep({&kick, 1}, 0);
}

}  // namespace

TEST_CASE("a cylinder that slides on its flat face stops after v^2 / (2 mu g)") {
  for (const Ground ground : {Ground::kPlane, Ground::kBox}) {
    for (const double substep : {1e-3, 2e-3, 5e-3, 10e-3}) {
      for (const double angle : {0.0, 0.4, M_PI / 4, M_PI}) {
        BulletWorld world(StandingCylinder(ground, 0.03, 0.02, 0.5), substep);
        Run(world, 1);
        const Vec3 start = world.State(1).pose.position;
        Push(world, 2 * Vec3(std::cos(angle), std::sin(angle), 0));
        Run(world, 1.5);
        const Vec3 way = world.State(1).pose.position - start;
        const double exact = 4 / (2 * 0.5 * kGravity);
        CAPTURE(static_cast<int>(ground), substep, angle, way.norm() - exact,
                world.State(1).pose.position.z());
        // The substep in which it stops is not moved at all: mu g h^2 / 2 at most.
        const double short_by = 0.5 * kGravity * substep * substep / 2;
        CHECK(way.head<2>().norm() < exact + 1e-6);
        CHECK(way.head<2>().norm() > exact - short_by - 1e-6);
        CHECK(std::abs(way.y() * std::cos(angle) - way.x() * std::sin(angle)) < 1e-6);
        CHECK(world.State(1).velocity.norm() < 1e-9);
        CHECK(world.State(1).pose.position.z() == Approx(0.02).margin(1e-5));
      }
    }
  }
}

TEST_CASE("a cylinder and a hull below stiction do not creep") {
  for (const Ground ground : {Ground::kPlane, Ground::kBox}) {
    for (const Shape& shape : {Shape(Cylinder{0.03, 0.02}), Shape(BoxHull({0.03, 0.03, 0.02})),
                               Shape(PillarHull(0.03, 0.02))}) {
      for (const double substep : {1e-3, 2e-3}) {
        BulletWorld world(OnGround(ground, shape, 0.03, 0.02, 0.3, {.position = {0, 0, 0.02}}),
                          substep);
        Run(world, 1);
        const Vec3 start = world.State(1).pose.position;
        for (int i = 0; i < std::lround(5 / substep); ++i) {
          const Kick kick{.body = 1, .impulse = {2 * substep, 0, 0}};
          world.ApplyAndStep({&kick, 1}, substep);
        }
        CAPTURE(static_cast<int>(ground), shape.index(), substep,
                (world.State(1).pose.position - start).transpose());
        CHECK((world.State(1).pose.position - start).norm() < 1e-6);
      }
    }
  }
}

TEST_CASE("cylinders and hulls of every size rest at their own height") {
  for (const Ground ground : {Ground::kPlane, Ground::kBox}) {
    for (const double size : {1e-3, 1e-2, 0.1}) {
      for (const Shape& shape :
           {Shape(Cylinder{size / 2, size / 3}), Shape(BoxHull({size / 2, 0.4 * size, size / 3})),
            Shape(PillarHull(size / 2, size / 3))}) {
        Scene scene =
            OnGround(ground, shape, size / 2, size / 3, 0.5, {.position = {0, 0, size / 3 * 1.02}});
        scene.bodies[1].pose_WB.orientation =
            Quat(Eigen::AngleAxisd(0.02, Vec3(1, 2, 0).normalized()));
        BulletWorld world(scene, kSubstep);
        Run(world, 2);
        const BodyState state = world.State(1);
        const double slop = 1e-4 * 2 * OuterBall(shape).radius;
        CAPTURE(static_cast<int>(ground), size, shape.index(), state.pose.position.z() - size / 3,
                slop);
        CHECK(std::abs(state.pose.position.z() - size / 3) <= slop * (1 + 1e-3));
        CHECK(state.velocity.norm() < 1e-6);
        CHECK(state.angular_velocity.norm() * size < 1e-6);
      }
    }
  }
}

// Bullet's own manifolds would take the corners of a small cube, 2 cm from each other at most, for one.
TEST_CASE("small cubes stand on boxes as large ones do") {
  for (const double edge : {1e-2, 0.1}) {
    for (const double angle : {0.0, M_PI / 4}) {
      Scene scene = test::CubeOnFloor(0.5, edge, 0.1);
      scene.bodies.push_back(test::Cube(edge, 0.1, 0.5, {0.3 * edge, 0, 1.51 * edge}));
      scene.bodies[2].pose_WB.orientation = Quat(Eigen::AngleAxisd(angle, Vec3::UnitZ()));
      BulletWorld world(scene, kSubstep);
      Run(world, 2);
      const BodyState state = world.State(2);
      const double slop = 1e-4 * std::sqrt(3) * edge;
      CAPTURE(edge, angle, state.pose.position.transpose(), state.velocity.norm());
      CHECK(std::abs(state.pose.position.z() - 1.5 * edge) <= 2.1 * slop);
      CHECK(std::abs(state.pose.position.x() - 0.3 * edge) < 1e-3 * edge);
      CHECK(state.pose.orientation.angularDistance(scene.bodies[2].pose_WB.orientation) < 1e-3);
      CHECK(state.velocity.norm() < 1e-5);
    }
  }
}

// A coin on its rim, upright, and a hull on a corner: they fall onto a face and lie.
TEST_CASE("what falls over comes to lie on a face") {
  for (const Ground ground : {Ground::kPlane, Ground::kBox}) {
    const std::vector<std::pair<Shape, double>> shapes = {{Cylinder{0.03, 0.004}, 0.004},
                                                          {PillarHull(0.03, 0.004), 0.004}};
    for (const auto& [shape, height] : shapes) {
      Pose start{.position = {0, 0, 0.031}};
      start.orientation = Quat(Eigen::AngleAxisd(1.2, Vec3(1, 0.3, 0).normalized()));
      BulletWorld world(OnGround(ground, shape, 0.03, 0.004, 0.5, start), kSubstep);
      double lowest = 1;
      double most = 0;
      for (int i = 0; i < 500; ++i) {
        world.ApplyAndStep({}, 0.01);
        const BodyState state = world.State(1);
        lowest = std::min(lowest, state.pose.position.z());
        const double energy = kGravity * state.pose.position.z() + state.velocity.squaredNorm() / 2;
        most = std::max(most, energy);
      }
      const BodyState state = world.State(1);
      CAPTURE(static_cast<int>(ground), shape.index(), state.pose.position.transpose(), lowest);
      CHECK(state.pose.position.z() == Approx(height).margin(1.1e-4 * 0.0606));
      CHECK(lowest > height - 2e-4);
      CHECK(most < kGravity * 0.0315);  // it gains nothing
      CHECK(state.velocity.norm() < 1e-6);
      CHECK(state.angular_velocity.norm() < 1e-4);
    }
  }
}

TEST_CASE("a rolling cylinder keeps rolling") {
  for (const Ground ground : {Ground::kPlane, Ground::kBox}) {
    for (const double substep : {1e-3, 2e-3}) {
      const double radius = 0.03;
      const Quat lying(Eigen::AngleAxisd(M_PI / 2, Vec3::UnitX()));
      Scene scene =
          OnGround(ground, Cylinder{radius, 0.04}, radius, 0.04, 0.5, {{-0.8, 0, radius}, lying});
      BulletWorld world(scene, substep);
      Run(world, 0.2);
      const Vec3 start = world.State(1).pose.position;
      const double speed = 0.7;
      Push(world, {speed, 0, 0}, {0, radius / 2 * speed, 0});
      Run(world, 2);
      const BodyState state = world.State(1);
      CAPTURE(static_cast<int>(ground), substep, state.velocity.transpose(),
              state.angular_velocity.transpose(), (state.pose.position - start).transpose());
      CHECK(state.velocity.x() == Approx(speed).epsilon(1e-3));
      CHECK(state.angular_velocity.y() == Approx(speed / radius).epsilon(1e-3));
      CHECK(state.pose.position.x() - start.x() == Approx(2 * speed).epsilon(1e-3));
      CHECK(std::abs(state.pose.position.y()) < 1e-6);
      // 1 slop deep: 1e-4 of the diameter of the ball round it, 0.1 m.
      CHECK(state.pose.position.z() == Approx(radius - 1e-5).margin(1e-8));
    }
  }
}

TEST_CASE("a cylinder or a hull that hits a box does not enter it, and keeps the momentum") {
  for (const Shape& shape : {Shape(Cylinder{0.03, 0.03}), Shape(BoxHull(Vec3::Constant(0.03))),
                             Shape(PillarHull(0.03, 0.03))}) {
    for (const double other_kg : {0.05, 0.5, 5.0}) {
      for (const double offset : {0.0, 0.01}) {
        Scene scene = test::FreeCube(other_kg);
        scene.bodies[0].pose_WB.position = {0.0702, offset, 0};
        scene.bodies.push_back(test::Cube(0.06, 0.5, 0.3, Vec3::Zero()));
        scene.bodies[1].colliders[0].shape = shape;
        BulletWorld world(scene, kSubstep);
        Push(world, {0.5 * 0.6, 0, 0});
        const auto momentum = [&] {
          return Vec3(other_kg * world.State(0).velocity + 0.5 * world.State(1).velocity);
        };
        const auto angular = [&] {
          Vec3 sum = Vec3::Zero();
          for (std::size_t i = 0; i < 2; ++i) {
            const BodyState s = world.State(i);
            const double mass = scene.bodies[i].mass_kg;
            sum += s.pose.position.cross(mass * s.velocity) +
                   mass * 0.06 * 0.06 / 6 * s.angular_velocity;
          }
          return sum;
        };
        const Vec3 before = momentum();
        const Vec3 angular_before = angular();
        for (int i = 0; i < 60; ++i) world.ApplyAndStep({}, kSubstep);
        CAPTURE(shape.index(), other_kg, offset, momentum().transpose(), angular().transpose());
        CHECK((momentum() - before).norm() < 1e-12);
        // Friction acts on each body on its own side of the gap, 0.6 mm before it closes: 1e-4 of the
        // blow's moment, 3 mN m s.
        CHECK((angular() - angular_before).norm() < 3e-6);
        if (offset == 0) {
          const double gap = world.State(0).pose.position.x() - world.State(1).pose.position.x();
          CHECK(gap > 0.06 - 2e-5);  // twice the depth at which they rest
          const double shared = 0.5 * 0.6 / (0.5 + other_kg);
          CHECK(world.State(0).velocity.x() == Approx(shared).epsilon(1e-3));
          CHECK(world.State(1).velocity.x() == Approx(shared).epsilon(1e-3));
        }
      }
    }
  }
}

}  // namespace rikiseki::world
