// SPDX-License-Identifier: MIT
// The local copies' step (common/body_step.h) against the world's engine: a copy that starts from
// the engine's settled bodies and contact sites, and never hears of the world again, must end where
// the engine ends. That is what one contact law on both sides means. numerics section 4.
#include "common/body_step.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "tests/lab/cube_push.h"
#include "world_server/features/nearest_point.h"
#include "world_server/physics/bullet_world.h"

namespace rikiseki::lab {
namespace {

constexpr double kTick = 1e-3;  // s

// The moving bodies of a settled scene, with all the contacts that they can reach.
struct Copies {
  std::vector<StepBody> bodies;
  std::vector<StepContact> contacts;

  explicit Copies(const world::Scene& scene) {
    world::BulletWorld engine(scene, kTick);
    engine.ApplyAndStep({}, 0.5);
    std::vector<std::size_t> place(scene.bodies.size(), StepContact::kSurroundings);
    for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
      const world::SceneBody& body = scene.bodies[i];
      if (body.fixed) continue;
      place[i] = bodies.size();
      bodies.push_back({.state = engine.State(i),
                        .inertia = BodyInertia::Of(body.mass_kg, body.inertia),
                        .acceleration = scene.gravity});
    }
    for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
      if (scene.bodies[i].fixed) continue;
      std::vector<world::ContactSite> sites;
      REQUIRE(engine.FindContacts(i, 0.045, sites));
      for (const world::ContactSite& site : sites) {
        const std::size_t other = place[site.other];
        if (other != StepContact::kSurroundings && other < place[i]) continue;  // seen already
        Add(place[i], engine.State(i).pose, other, engine.State(site.other).pose, site);
      }
    }
  }

  void Add(std::size_t body, const Pose& pose_WB, std::size_t other, const Pose& pose_WO,
           const world::ContactSite& site) {
    const Vec3 on_body = pose_WB * site.p_B - site.radius * site.normal;
    StepContact contact{.body = body,
                        .other = other,
                        .p_B = site.p_B,
                        .radius = site.radius,
                        .point = on_body - site.gap * site.normal,
                        .normal = site.normal,
                        .friction = site.friction,
                        .normal_impulse = std::max(0.0, site.impulse.dot(site.normal))};
    if (other != StepContact::kSurroundings) {
      contact.point = pose_WO.Inverse() * contact.point;
      contact.normal = pose_WO.orientation.conjugate() * contact.normal;
    }
    contacts.push_back(contact);
  }
};

PushResult SimulateCopyAlone(const CubePush& push) {
  Copies copies(PushScene(push));
  BodyState& cube = copies.bodies[0].state;
  const Vec3 start = cube.pose.position;
  PushResult result;
  double depth_before = 0;
  double force_sum = 0;
  const long ticks = std::lround(Duration(push) / kTick);
  for (long k = 0; k < ticks; ++k) {
    const Vec3 finger = FingerPosition(push, start, static_cast<double>(k) * kTick);
    const world::NearestPoint nearest = world::FindNearestPoint(
        world::Box{Vec3::Constant(kCubeHalf)}, cube.pose.Inverse() * finger);
    const double depth = std::max(0.0, kFingerRadius - nearest.distance);
    double force = 0;
    if (depth > 0) {
      force = std::max(0.0, push.stiffness_n_per_m * depth +
                                push.damping_ns_per_m * (depth - depth_before) / kTick);
    }
    depth_before = depth;
    result.force_peak_n = std::max(result.force_peak_n, force);
    force_sum += force;
    const Vec3 normal = cube.pose.orientation * nearest.normal;
    const Vec3 impulse = -force * kTick * normal;
    const Vec3 arm = finger - (kFingerRadius - depth) * normal - cube.pose.position;
    ApplyImpulse(copies.bodies[0].inertia, impulse, arm.cross(impulse), cube);
    StepBodies(copies.bodies, copies.contacts, kTick, PositionRule::kSecondOrder);
  }
  result.displacement_m = cube.pose.position.x() - start.x();
  result.force_mean_n = force_sum / static_cast<double>(ticks);
  const Mat3 axes = cube.pose.orientation.toRotationMatrix();
  result.yaw_rad = std::atan2(axes(1, 0), axes(0, 0));
  return result;
}

}  // namespace

TEST_CASE("a copy alone ends where the engine ends, along one line") {
  for (const PushScript script : {PushScript::kPush, PushScript::kPoke, PushScript::kHold}) {
    for (const double mass_kg : {1.0, 0.1, 0.005}) {
      CubePush push;
      push.script = script;
      push.mass_kg = mass_kg;
      push.damping_ns_per_m = script == PushScript::kHold ? 2 : 0;
      CAPTURE(static_cast<int>(script), mass_kg);
      const PushResult engine = SimulateCubePush(push, {});
      const PushResult copy = SimulateCopyAlone(push);
      // The engine adds the last way of what comes to stick within a substep, at most mu g h^2/2 for each
      // stop (bullet_hooks.cpp); a copy does not know the speed before the push.
      const double last_way_m = push.friction * 9.81 * 1e-6 / 2;
      CHECK(copy.displacement_m == Approx(engine.displacement_m).epsilon(1e-4).margin(last_way_m));
      CHECK(copy.force_peak_n == Approx(engine.force_peak_n).epsilon(1e-4));
    }
  }
}

TEST_CASE("a copy alone neither creeps under a push below stiction nor sinks under a press") {
  for (const PushScript script : {PushScript::kStick, PushScript::kPress}) {
    CubePush push;
    push.script = script;
    push.mass_kg = script == PushScript::kStick ? 0.5 : 0.005;
    const PushResult copy = SimulateCopyAlone(push);
    CHECK(std::abs(copy.displacement_m) < 1e-8);
    CHECK(copy.force_peak_n == Approx(script == PushScript::kStick ? 1.0 : 4.0).epsilon(1e-4));
  }
}

// Four corners share the load in more ways than one; only the engine's order of sweeps gives its
// share, and so its turn. Half of the displacement's bar in numerics section 5, and all of the yaw's.
TEST_CASE("a copy alone turns as the engine does under a push beside the middle") {
  for (const double offset_m : {0.01, -0.01, 0.02, -0.02}) {
    for (const double mass_kg : {0.5, 0.1}) {
      CubePush push;
      push.script = PushScript::kOffCentre;
      push.mass_kg = mass_kg;
      push.offset_m = offset_m;
      CAPTURE(offset_m, mass_kg);
      const PushResult engine = SimulateCubePush(push, {});
      const PushResult copy = SimulateCopyAlone(push);
      CHECK(copy.displacement_m == Approx(engine.displacement_m).epsilon(0.005));
      CHECK(copy.yaw_rad == Approx(engine.yaw_rad).margin(0.5 * M_PI / 180));
      CHECK(std::abs(engine.yaw_rad) > 0.4);
    }
  }
}

TEST_CASE("copies of a cube and its neighbour end where the engine ends") {
  for (const double neighbour_kg : {0.05, 0.5, 5.0}) {
    CubePush push;
    push.script = PushScript::kNeighbour;
    push.mass_kg = 0.5;
    push.gap_m = 0.01;
    push.neighbour_kg = neighbour_kg;
    CAPTURE(neighbour_kg);
    CHECK(SimulateCopyAlone(push).displacement_m ==
          Approx(SimulateCubePush(push, {}).displacement_m).epsilon(0.03));
  }
}

}  // namespace rikiseki::lab
