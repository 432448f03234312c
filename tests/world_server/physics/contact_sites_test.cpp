// SPDX-License-Identifier: MIT
#include "world_server/physics/contact_sites.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "tests/world_server/scenes.h"

namespace rikiseki::world {
namespace {

std::vector<BodyState> StatesOf(const Scene& scene) {
  std::vector<BodyState> states;
  for (const SceneBody& body : scene.bodies) states.push_back({.pose = body.pose_WB});
  return states;
}

SceneBody Ball(double radius, double mass_kg, double friction, const Vec3& position) {
  SceneBody ball = test::Cube(2 * radius, mass_kg, friction, position);
  ball.colliders[0].shape = Sphere{radius};
  return ball;
}

}  // namespace

TEST_CASE("a cube on the floor: the corners that the reach holds, lowest first, gap said") {
  Scene scene = test::CubeOnFloor(0.3);
  scene.bodies[1].colliders[0].friction = 0.5;
  scene.bodies[1].pose_WB.position.z() = 0.032;
  const std::vector<BodyState> states = StatesOf(scene);
  for (const double reach : {0.001, 0.01, 0.1}) {
    std::vector<ContactSite> sites(1);  // appends
    REQUIRE(SiteFinder(scene).Find(states, 1, reach, sites));
    REQUIRE(sites.size() == 1 + (reach < 0.002 ? 0U : reach < 0.062 ? 4U : 8U));
    for (std::size_t i = 1; i < sites.size(); ++i) {
      const ContactSite& site = sites[i];
      CHECK(site.other == 0);
      CHECK(site.gap == Approx(i <= 4 ? 0.002 : 0.062).epsilon(1e-9));
      CHECK(site.normal == Vec3::UnitZ());
      CHECK(site.radius == 0);
      CHECK((site.p_B.cwiseAbs() - Vec3::Constant(0.03)).norm() < 1e-12);
      CHECK(site.friction == Approx(std::sqrt(0.3 * 0.5)));
      CHECK(site.other_inverse_mass == 0);
      CHECK(site.impulse.isZero(0));
    }
  }
}

TEST_CASE("a ball touches with its rounding") {
  Scene scene;
  scene.bodies = {test::Floor(0.4), Ball(0.02, 1, 0.4, {0, 0, 0.025}),
                  test::Cube(0.06, 2, 0.9, {0.06, 0, 0.03})};
  std::vector<BodyState> states = StatesOf(scene);
  states[2].velocity = {0.1, 0, 0};
  states[2].angular_velocity = {0, 0, 2};
  std::vector<ContactSite> sites;
  REQUIRE(SiteFinder(scene).Find(states, 1, 0.02, sites));
  REQUIRE(sites.size() == 2);
  CHECK(sites[0].other == 0);
  CHECK(sites[0].gap == Approx(0.005));
  CHECK(sites[0].radius == 0.02);
  CHECK(sites[0].p_B.norm() < 1e-15);
  CHECK(sites[1].other == 2);
  CHECK(sites[1].gap == Approx(0.01));
  CHECK((sites[1].normal + Vec3::UnitX()).norm() < 1e-12);
  CHECK(sites[1].friction == Approx(0.6));
  // At the ball's own point (0.02, 0, 0.025): 0.04 before the cube's centre and 5 mm below it.
  CHECK(
      (sites[1].other_velocity - Vec3(0.1, 0, 0) - Vec3(0, 0, 2).cross(Vec3(-0.04, 0, 0))).norm() <
      1e-12);
  const double moment = 2 * 0.06 * 0.06 / 6;
  CHECK(sites[1].other_inverse_mass == Approx(1 / 2.0 + 0.005 * 0.005 / moment).epsilon(1e-9));

  // And the cube's contact with the ball: a point of the cube, the normal out of the ball.
  sites.clear();
  REQUIRE(SiteFinder(scene).Find(states, 2, 0.02, sites));
  REQUIRE(sites.size() == 5);
  CHECK(sites[4].other == 1);
  CHECK((sites[4].p_B - Vec3(-0.03, 0, -0.005)).norm() < 1e-12);
  CHECK((sites[4].normal - Vec3::UnitX()).norm() < 1e-12);
  CHECK(sites[4].gap == Approx(0.01));
}

TEST_CASE("cube beside cube") {
  Scene scene = test::CubeOnFloor(0.3);
  scene.bodies.push_back(test::Cube(0.06, 1, 0.3, {0.065, 0, 0.03}));
  std::vector<ContactSite> sites;
  REQUIRE(SiteFinder(scene).Find(StatesOf(scene), 1, 0.01, sites));
  CHECK(sites.size() == 8);
}

TEST_CASE("a lying cylinder and a capsule touch with their roundings, at both ends") {
  const Quat lying(Eigen::AngleAxisd(std::numbers::pi / 2, Vec3::UnitX()));
  for (const Shape& shape : {Shape(Cylinder{0.03, 0.04}), Shape(Capsule{0.03, 0.04})}) {
    for (const bool on_box : {false, true}) {
      Scene scene = test::CubeOnFloor(0.3);
      if (on_box) {
        scene.bodies[0].colliders[0].shape = Box{{0.5, 0.5, 0.05}};
        scene.bodies[0].colliders[0].pose_BS.position.z() = -0.05;
      }
      scene.bodies[1].colliders[0].shape = shape;
      scene.bodies[1].pose_WB = {{0, 0, 0.032}, lying};
      std::vector<ContactSite> sites;
      REQUIRE(SiteFinder(scene).Find(StatesOf(scene), 1, 0.01, sites));
      CAPTURE(shape.index(), on_box);
      REQUIRE(sites.size() == 2);
      for (const ContactSite& site : sites) {
        CHECK(site.radius == 0.03);
        CHECK(site.gap == Approx(0.002).epsilon(1e-9));
        // On the axis: wherever it rolls, it touches below its middle.
        CHECK(site.p_B.head<2>().norm() < 1e-12);
        CHECK(std::abs(site.p_B.z()) == Approx(0.04).epsilon(1e-9));
      }
      CHECK(sites[0].p_B.z() * sites[1].p_B.z() < 0);
    }
  }
}

// An ellipsoid that rolls about an axis of its own is an ellipse, whose middle is
// h = sqrt(a^2 sin^2 t + c^2 cos^2 t) above the floor when it has turned by t.
TEST_CASE("an ellipsoid touches with its curvature along the way that it rolls") {
  Scene scene = test::CubeOnFloor(0.3);
  const Vec3 radii(0.03, 0.025, 0.02);
  scene.bodies[1].colliders[0].shape = Ellipsoid{radii};
  for (const int along : {0, 1}) {  // rolls along x or y
    for (const double tilt : {0.0, 0.4}) {
      const Vec3 axis = along == 0 ? Vec3(Vec3::UnitY()) : Vec3(-Vec3::UnitX());
      const auto height = [&](double t) {
        return std::hypot(radii[along] * std::sin(t), radii.z() * std::cos(t));
      };
      scene.bodies[1].pose_WB = {{0, 0, height(tilt)}, Quat(Eigen::AngleAxisd(tilt, axis))};
      std::vector<BodyState> states = StatesOf(scene);
      states[1].angular_velocity = 2 * axis;
      std::vector<ContactSite> sites;
      REQUIRE(SiteFinder(scene).Find(states, 1, 0.01, sites));
      REQUIRE(sites.size() == 1);
      CHECK(sites[0].gap == Approx(0).margin(1e-12));
      for (const double turn : {-0.05, 0.05}) {
        const Quat turned(Eigen::AngleAxisd(tilt + turn, axis));
        const double touches = -(turned * sites[0].p_B).z() + sites[0].radius;
        CAPTURE(along, tilt, turn, sites[0].radius);
        // A ball that touches alike differs in the third order: the third derivative of h is below
        // 6 (a^2 - c^2) / c here, so by 0.025 * 0.05^3; a curvature wrong by a fifth is 7e-6 off.
        CHECK(touches == Approx(height(tilt + turn)).margin(0.025 * 1.25e-4));
      }
    }
  }
}

}  // namespace rikiseki::world
