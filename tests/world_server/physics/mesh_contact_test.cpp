// SPDX-License-Identifier: MIT
// Bodies on meshes: a flat mesh of many triangles is a plane, and edges are felt only where the surface
// ends in them.
#include "world_server/physics/mesh_contact.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>
#include <random>

#include "tests/world_server/meshes.h"
#include "tests/world_server/scenes.h"
#include "world_server/geometry/convex_hull.h"
#include "world_server/physics/bullet_world.h"
#include "world_server/physics/shape_contact.h"

namespace rikiseki::world {
namespace {

constexpr double kSubstep = 1e-3;
const Quat kLying(Eigen::AngleAxisd(std::numbers::pi / 2, Vec3::UnitX()));

// A slab with its top at z = 0, of irregular triangles about 5 cm wide.
Mesh Ground(double low_x, double high_x, double half_y) {
  std::mt19937 random(17);
  std::uniform_real_distribution<double> any(-0.015, 0.015);
  const int n_x = static_cast<int>(std::lround((high_x - low_x) / 0.05));
  const int n_y = static_cast<int>(std::lround(2 * half_y / 0.05));
  std::vector<Vec3> grid;
  for (int i = 0; i <= n_x; ++i) {
    for (int j = 0; j <= n_y; ++j) {
      const bool border = i == 0 || j == 0 || i == n_x || j == n_y;
      const double shift_x = any(random), shift_y = any(random);
      grid.emplace_back(low_x + 0.05 * i + (border ? 0 : shift_x),
                        -half_y + 0.05 * j + (border ? 0 : shift_y), 0);
    }
  }
  test::RawMesh raw;
  const auto at = [&](int i, int j) { return grid[static_cast<std::size_t>(i * (n_y + 1) + j)]; };
  const auto under = [&](int i, int j) { return Vec3(at(i, j) - 0.1 * Vec3::UnitZ()); };
  for (int i = 0; i < n_x; ++i) {
    for (int j = 0; j < n_y; ++j) {
      raw.AddQuad(at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
      raw.AddQuad(under(i, j), under(i, j + 1), under(i + 1, j + 1), under(i + 1, j));
    }
    raw.AddQuad(at(i, 0), under(i, 0), under(i + 1, 0), at(i + 1, 0));
    raw.AddQuad(at(i, n_y), at(i + 1, n_y), under(i + 1, n_y), under(i, n_y));
  }
  for (int j = 0; j < n_y; ++j) {
    raw.AddQuad(at(0, j), at(0, j + 1), under(0, j + 1), under(0, j));
    raw.AddQuad(at(n_x, j), under(n_x, j), under(n_x, j + 1), at(n_x, j + 1));
  }
  return {.mesh = std::make_shared<const TriangleMesh>(raw.corners, raw.triangles)};
}

Hull BoxHull(const Vec3& half) {
  return {.mesh = std::make_shared<const TriangleMesh>(
              ConvexHull(test::Build(test::BoxMesh(half)).corners()))};
}

// The points of one list in the other, each with its gap and normal.
bool SamePoints(const std::vector<ContactPoint>& a, const std::vector<ContactPoint>& b,
                double margin) {
  if (a.size() != b.size()) return false;
  return std::ranges::all_of(a, [&](const ContactPoint& point) {
    return std::ranges::any_of(b, [&](const ContactPoint& other) {
      return (point.point_W - other.point_W).norm() < margin &&
             (point.normal_W - other.normal_W).norm() < margin &&
             std::abs(point.gap - other.gap) < margin && point.radius == other.radius;
    });
  });
}

struct Start {
  Shape shape;
  Quat orientation = Quat::Identity();
  double height = 0.03;
  Vec3 spin = Vec3::Zero();  // per speed along x
};

const std::vector<Start>& Starts() {
  static const std::vector<Start> kStarts = {
      {Box{Vec3::Constant(0.03)}},
      {BoxHull(Vec3::Constant(0.03))},
      {Cylinder{0.03, 0.03}},
      {Cylinder{0.03, 0.03}, kLying, 0.03, Vec3::UnitY() / 0.03},
      {Capsule{0.03, 0.02}, kLying, 0.03, Vec3::UnitY() / 0.03},
      {Sphere{0.03}, Quat::Identity(), 0.03, Vec3::UnitY() / 0.03},
      {Ellipsoid{{0.03, 0.04, 0.03}}, Quat::Identity(), 0.03, Vec3::UnitY() / 0.03}};
  return kStarts;
}

}  // namespace

TEST_CASE("on a flat mesh every shape has the contacts that it has on a plane") {
  const Solid mesh{Shape(Ground(-0.3, 0.3, 0.3))};
  REQUIRE(std::get<Mesh>(mesh.shape).mesh->flaws().closed());
  const Solid plane{Shape(HalfSpace{})};
  std::mt19937 random(23);
  std::uniform_real_distribution<double> any(-1, 1);
  for (const Start& start : Starts()) {
    const Solid solid(start.shape);
    for (int i = 0; i < 200; ++i) {
      const double tilt = i % 2 == 0 ? 0 : 1e-4 * any(random);
      Pose pose{{0.15 * any(random), 0.15 * any(random), start.height + 1e-4 * any(random)},
                Quat(Eigen::AngleAxisd(tilt, Vec3::UnitX())) *
                    Quat(Eigen::AngleAxisd(3 * any(random), Vec3::UnitZ())) * start.orientation};
      // What is one support polygon on a plane: a corner stands out by 1e-6 of the size here.
      const auto on_plane = FindShapeContact(solid, pose, plane, {}, 1e-3);
      const auto on_mesh = FindShapeContact(solid, pose, mesh, {}, 1e-3);
      CAPTURE(start.shape.index(), i, tilt, on_plane.size(), on_mesh.size());
      REQUIRE(SamePoints(on_mesh, on_plane, 1e-6));
    }
  }
}

TEST_CASE("what slides and rolls over a flat mesh goes as on a plane, and catches nowhere") {
  for (const Start& start : Starts()) {
    std::vector<Vec3> ends;
    for (const bool on_mesh : {false, true}) {
      Scene scene = test::CubeOnFloor(0.5);
      if (on_mesh) scene.bodies[0].colliders[0].shape = Ground(-0.2, 1.3, 0.2);
      SceneBody& body = scene.bodies[1];
      body.colliders[0].shape = start.shape;
      body.pose_WB = {{0, 0.003, start.height}, start.orientation};
      BulletWorld world(scene, kSubstep);
      for (int i = 0; i < 20; ++i) world.ApplyAndStep({}, 0.01);
      const double speed = start.spin.isZero() ? 2 : 0.7;
      const Vec3 spin = body.inertia * (speed * start.spin);
      const Kick kick{.body = 1, .impulse = {speed, 0, 0}, .angular_impulse = spin};
      world.ApplyAndStep({&kick, 1}, 0);
      for (int i = 0; i < 100; ++i) {
        world.ApplyAndStep({}, 0.01);
        REQUIRE(world.State(1).pose.position.z() == Approx(start.height).margin(2e-5));
      }
      ends.push_back(world.State(1).pose.position);
    }
    CAPTURE(start.shape.index(), ends[0].transpose(), ends[1].transpose());
    CHECK((ends[0] - ends[1]).norm() < 5e-5);
    CHECK(ends[0].x() > 0.4);
  }
}

TEST_CASE("over the ridge of a mesh the edge touches, at its foot both sides do") {
  // A roof along y: its ridge at z = 0, its sides at 45 degrees; and a valley of two of them.
  const auto ridge = test::Prism({{0, 0}, {-0.2, -0.2}, {0.2, -0.2}}, 0.3);
  const auto valley =
      test::Prism({{0, 0}, {-0.2, 0.2}, {-0.2, -0.1}, {0.2, -0.1}, {0.2, 0.2}}, 0.3);
  const Solid roof{Shape(Mesh{.mesh = std::make_shared<const TriangleMesh>(test::Build(ridge))})};
  const Solid gutter{
      Shape(Mesh{.mesh = std::make_shared<const TriangleMesh>(test::Build(valley))})};
  const auto on_ridge = FindShapeContact(Solid{Shape(Box{Vec3::Constant(0.03)})},
                                         {.position = {0.01, 0, 0.0301}}, roof, {}, 1e-3);
  REQUIRE(on_ridge.size() == 2);
  for (const ContactPoint& point : on_ridge) {
    CHECK((point.normal_W - Vec3::UnitZ()).norm() < 1e-9);
    CHECK(point.gap == Approx(1e-4).margin(1e-12));
    CHECK(point.point_W.x() == Approx(0).margin(1e-9));
    CHECK(std::abs(point.point_W.y()) == Approx(0.03));
  }
  const double up = 0.03 * std::sqrt(2.0);
  const auto in_valley = FindShapeContact(Solid{Shape(Cylinder{0.03, 0.04})},
                                          {{0, 0, up + 1e-4}, kLying}, gutter, {}, 1e-3);
  REQUIRE(in_valley.size() == 4);
  for (const ContactPoint& point : in_valley) {
    CHECK(std::abs(point.normal_W.x()) == Approx(std::sqrt(0.5)));
    CHECK(point.normal_W.z() == Approx(std::sqrt(0.5)));
    CHECK(point.gap == Approx(1e-4 * std::sqrt(0.5)).margin(1e-9));
    CHECK(point.radius == 0.03);
  }
}

TEST_CASE("every shape rests on a mesh at its own height, and does not creep") {
  for (const Start& start : Starts()) {
    if (!start.spin.isZero()) continue;  // rolls
    Scene scene = test::CubeOnFloor(0.5);
    scene.bodies[0].colliders[0].shape = Ground(-0.2, 0.2, 0.2);
    scene.bodies[1].colliders[0].shape = start.shape;
    scene.bodies[1].pose_WB.position = {0.004, 0.003, start.height + 1e-3};
    BulletWorld world(scene, kSubstep);
    for (int i = 0; i < 100; ++i) world.ApplyAndStep({}, 0.01);
    const Vec3 rests = world.State(1).pose.position;
    CAPTURE(start.shape.index(), rests.transpose());
    CHECK(rests.z() == Approx(start.height).margin(2e-5));
    for (int i = 0; i < 2000; ++i) {
      const Kick kick{.body = 1, .impulse = {2 * kSubstep, 0, 0}};  // 2 N, below stiction
      world.ApplyAndStep({&kick, 1}, kSubstep);
    }
    CHECK((world.State(1).pose.position - rests).norm() < 1e-5);
  }
}

}  // namespace rikiseki::world
