// SPDX-License-Identifier: MIT
// What contacts gave a body, as its local copy is told: all of what carries it.
#include <catch2/catch.hpp>
#include <vector>

#include "tests/world_server/jointed_scenes.h"
#include "world_server/physics/bullet_world.h"

namespace rikiseki::world {
namespace {

constexpr double kSubstep = 1e-3;  // s

}  // namespace

TEST_CASE("contacts carry a body at rest, along the slope and across it, on what is jointed too") {
  for (const bool jointed : {false, true}) {
    Scene scene;
    scene.gravity = {1.2, -0.9, -9.81};  // a slope, along no axis of the scene
    scene.bodies = {test::Block({0.2, 0.2, 0.01}, 0.4, {}),
                    test::Block({0.03, 0.03, 0.03}, 0.05, {.position = {0.02, 0.01, 0.02}})};
    if (jointed) {
      scene.joints = {test::JoinAt(scene, Joint::Type::kRevolute, Joint::kWorld, 0, Vec3::Zero(),
                                   Vec3::UnitZ())};
      scene.joints[0].friction = 1;  // N m: the plate stands
    } else {
      scene.bodies[0].fixed = true;
    }
    BulletWorld world(scene, kSubstep);
    world.ApplyAndStep({}, 0.5);
    std::vector<ContactSite> sites;
    REQUIRE(world.FindContacts(1, 1e-3, sites));
    Vec3 sum = Vec3::Zero();
    for (const ContactSite& site : sites) sum += site.impulse;
    CAPTURE(jointed, sum);
    // Its weight in a substep: 1e-7 N s more or less would change its speed by 2 um/s in each.
    CHECK((sum + 0.05 * kSubstep * scene.gravity).norm() < 1e-7);
  }
}

}  // namespace rikiseki::world
