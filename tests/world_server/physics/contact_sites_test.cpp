#include "world_server/physics/contact_sites.h"

#include <catch2/catch.hpp>
#include <cmath>

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
    REQUIRE(FindContactSites(scene, states, 1, reach, sites));
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
  REQUIRE(FindContactSites(scene, states, 1, 0.02, sites));
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
  REQUIRE(FindContactSites(scene, states, 2, 0.02, sites));
  REQUIRE(sites.size() == 5);
  CHECK(sites[4].other == 1);
  CHECK((sites[4].p_B - Vec3(-0.03, 0, -0.005)).norm() < 1e-12);
  CHECK((sites[4].normal - Vec3::UnitX()).norm() < 1e-12);
  CHECK(sites[4].gap == Approx(0.01));
}

TEST_CASE("cube beside cube, and shapes that are not known") {
  Scene scene = test::CubeOnFloor(0.3);
  scene.bodies.push_back(test::Cube(0.06, 1, 0.3, {0.065, 0, 0.03}));
  std::vector<ContactSite> sites;
  REQUIRE(FindContactSites(scene, StatesOf(scene), 1, 0.01, sites));
  CHECK(sites.size() == 8);
  sites.clear();
  scene.bodies[2].colliders[0].shape = Cylinder{0.03, 0.03};
  CHECK_FALSE(FindContactSites(scene, StatesOf(scene), 1, 0.01, sites));
  CHECK(sites.empty());
  CHECK_FALSE(FindContactSites(scene, StatesOf(scene), 2, 0.01, sites));
  // Out of reach it does not matter.
  scene.bodies[2].pose_WB.position.x() = 0.3;
  CHECK(FindContactSites(scene, StatesOf(scene), 1, 0.01, sites));
  CHECK(sites.size() == 4);
}

}  // namespace rikiseki::world
