// SPDX-License-Identifier: MIT
#include "tests/lab/linear_stations.h"

#include <array>
#include <span>

#include "common/body_step.h"
#include "haptic_server/render/contact_solve.h"
#include "haptic_server/render/feature_track.h"
#include "haptic_server/render/local_bodies.h"
#include "haptic_server/render/surface_force.h"
#include "world_server/coupling/kick.h"
#include "world_server/physics/sliding_block.h"

namespace rikiseki::lab {
namespace {

constexpr double kDepth = 1;           // m, of the contact about which is read
constexpr double kDeviation = 0.5;     // m, so the contact holds
const Vec3 kOutward = -Vec3::UnitX();  // of the body, which the finger pushes along +x

protocol::WorldFrame Frame(double surface_x, int ticks, std::int64_t period_ns) {
  protocol::WorldFrame frame;
  frame.period_ns = static_cast<std::uint64_t>(ticks * period_ns);
  frame.plane_count = 1;
  frame.planes[0].point = {surface_x, 0, 0};
  frame.planes[0].normal = ToArray(kOutward);
  return frame;
}

// The displayed surfaces of one world period, after a frame at `previous` and one at `last`.
std::vector<double> Displayed(haptic::DisplayRule rule, int ticks, double previous, double last) {
  constexpr std::int64_t kPeriodNs = 1'000'000;  // any: weights depend on their number only
  haptic::FeatureTrack track(rule, kPeriodNs);
  const haptic::LocalBodies no_copies(kPeriodNs, 0, 0, PositionRule::kSemiImplicit);
  const haptic::FingerState finger{.position = Vec3(-1e3, 0, 0)};  // far: nothing to recover from
  track.Receive(Frame(previous, ticks, kPeriodNs), {&finger, 1}, no_copies);
  track.Advance(ticks);
  track.Receive(Frame(last, ticks, kPeriodNs), {&finger, 1}, no_copies);
  std::vector<double> shown;
  for (int j = 0; j < ticks; ++j) {
    if (j > 0) track.Advance(1);
    shown.push_back(track.Surfaces(no_copies)[0].plane.point.x());
  }
  return shown;
}

world::Scene OneBlock(double mass_kg) {
  world::Collider face;
  face.shape = world::HalfSpace{.normal = kOutward};
  world::SceneBody block;
  block.name = "block";
  block.mass_kg = mass_kg;
  block.inertia = Mat3::Identity();
  block.colliders = {face};
  world::Scene scene;
  scene.bodies = {block};
  return scene;
}

StepBody BodyOf(double mass_kg) {
  StepBody body;
  body.inertia = BodyInertia::Of(mass_kg, Mat3::Identity());
  return body;
}

}  // namespace

std::vector<DisplayWeights> ReadDisplay(haptic::DisplayRule rule, int ticks) {
  const std::vector<double> of_previous = Displayed(rule, ticks, 1, 0);
  const std::vector<double> of_last = Displayed(rule, ticks, 0, 1);
  std::vector<DisplayWeights> weights;
  for (std::size_t j = 0; j < of_last.size(); ++j) weights.push_back({of_previous[j], of_last[j]});
  return weights;
}

ContactGains ReadContact(double stiffness_n_per_m, double damping_ns_per_m, double period_s) {
  haptic::RenderSettings settings;
  settings.stiffness_n_per_m = stiffness_n_per_m;
  settings.damping_ns_per_m = damping_ns_per_m;
  settings.adhesion = true;
  haptic::Surface surface;
  surface.plane = {Vec3::Zero(), kOutward};
  const auto force_on_body = [&](double depth_before, double depth) {
    haptic::SurfaceForce surface_force(settings, period_s);
    double force = 0;
    for (const double now : {depth_before, depth}) {
      const auto contact = haptic::SolveContact(Vec3(now, 0, 0), 0, {&surface.plane, 1});
      const auto shares = surface_force.Update({&surface, 1}, contact, 0, 1);
      force = shares.empty() ? 0 : -shares.front().force.x();
    }
    return force;
  };
  const double base = force_on_body(kDepth, kDepth);
  return {.now = (force_on_body(kDepth, kDepth + kDeviation) - base) / kDeviation,
          .before = (force_on_body(kDepth + kDeviation, kDepth) - base) / kDeviation};
}

double ReadPenalty(double stiffness_n_per_m, double world_period_s) {
  const world::Scene scene = OneBlock(1);
  const BodyState state;
  const auto impulse = [&](double depth) {
    const world::Finger finger{.position = Vec3(depth, 0, 0)};
    const auto kicks = world::PenaltyKicks(scene, {&state, 1}, {&finger, 1},
                                           {.stiffness_n_per_m = stiffness_n_per_m,
                                            .period_s = world_period_s,
                                            .largest_impulse_ns = 1e300});
    return kicks.at(0).impulse.x();
  };
  return (impulse(kDepth + kDeviation) - impulse(kDepth)) / kDeviation;
}

BodyGains ReadBodyStep(double mass_kg, double step_s) {
  const auto step = [&](double speed, double impulse_ns) {
    StepBody body = BodyOf(mass_kg);
    body.state.velocity.x() = speed;
    ApplyImpulse(body.inertia, Vec3(impulse_ns, 0, 0), Vec3::Zero(), body.state);
    StepBodies({&body, 1}, {}, step_s, PositionRule::kSemiImplicit);
    return body.state;
  };
  const BodyState coasted = step(1, 0);
  const BodyState kicked = step(0, 1);
  return {.shift_per_speed = coasted.pose.position.x(),
          .shift_per_impulse = kicked.pose.position.x(),
          .speed_per_impulse = kicked.velocity.x()};
}

BodyGains ReadWorldStep(double mass_kg, double world_period_s) {
  world::SlidingBlock block(OneBlock(mass_kg), 0, world::SlideRule::kSemiImplicit);
  const world::Kick kick{.body = 0, .impulse = Vec3::UnitX()};
  block.ApplyAndStep({&kick, 1}, world_period_s);
  const BodyState kicked = block.State(0);
  block.ApplyAndStep({}, world_period_s);
  const BodyState coasted = block.State(0);
  return {.shift_per_speed =
              (coasted.pose.position.x() - kicked.pose.position.x()) / coasted.velocity.x(),
          .shift_per_impulse = kicked.pose.position.x(),
          .speed_per_impulse = kicked.velocity.x()};
}

ImplicitGains ReadImplicitStep(double stiffness_n_per_m, double damping_ns_per_m, double mass_kg,
                               double period_s) {
  const auto impulse = [&](double depth, double speed) {
    StepBody body = BodyOf(mass_kg);
    body.state.velocity.x() = speed;
    StepSpring spring;
    spring.point_W = body.state.pose.position;
    spring.normal = kOutward;
    spring.base_ns = period_s * stiffness_n_per_m * depth;
    spring.per_speed_kg = period_s * (period_s * stiffness_n_per_m + damping_ns_per_m);
    SolveVelocities({&body, 1}, {}, {&spring, 1}, period_s);
    return spring.impulse_ns;
  };
  // A speed that lifts the force by less than the pre-load.
  const double speed = -kDeviation / period_s;
  const double base = impulse(kDepth, 0);
  return {.per_depth = (impulse(kDepth + kDeviation, 0) - base) / kDeviation,
          .per_speed = (impulse(kDepth, speed) - base) / speed};
}

}  // namespace rikiseki::lab
