// SPDX-License-Identifier: MIT
#include "tests/lab/block_push.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <stdexcept>
#include <utility>

#include "tests/lab/ideal_device.h"
#include "world_server/physics/bullet_world.h"
#include "world_server/physics/sliding_block.h"

namespace rikiseki::lab {
namespace {

constexpr double kDuration = 3;     // s
constexpr double kCubeHalf = 0.03;  // m, of the block in the engine
constexpr double kUnlimited = 1e9;  // for limits that must not act: N, N/s, m/s, mm

// The written experiment knows no limits: they are set so wide that they never act.
haptic::Settings HapticSettings(const BlockPush& push) {
  haptic::Settings settings;
  settings.loop.rate_hz = 1 / push.haptic_period_s;
  settings.loop.longest_world_period_ms =
      std::max(settings.loop.longest_world_period_ms, push.world_period_s * 1e3);
  settings.render.stiffness_n_per_m = push.stiffness_n_per_m;
  settings.render.damping_ns_per_m = push.damping_ns_per_m;
  settings.render.adhesion = true;
  settings.render.display = push.display;
  settings.render.finger_radius_mm = 0;
  settings.render.position_rule = push.position_rule;
  settings.safety.force_cap_n = kUnlimited;
  settings.safety.slew_limit_n_per_s = kUnlimited * 1e6;  // the whole cap in a microsecond
  settings.safety.speed_limit_m_per_s = kUnlimited;
  settings.safety.soft_start_ms = 0;
  return settings;
}

world::Settings WorldSettings(const BlockPush& push) {
  world::Settings settings;
  settings.loop.rate_hz = 1 / push.world_period_s;
  settings.coupling.coupling = push.coupling;
  settings.coupling.replay =
      push.local == LocalVariant::kLump ? world::ReplayRule::kLump : world::ReplayRule::kTicks;
  settings.coupling.force_cap_n = kUnlimited;
  settings.features.radius_mm = kUnlimited;
  return settings;
}

world::Collider MakeCollider(const world::Shape& shape, double friction) {
  world::Collider collider;
  collider.shape = shape;
  collider.friction = friction;
  return collider;
}

// The block of the written experiment is its front face and everything behind it.
world::Scene SlidingScene(const BlockPush& push) {
  world::SceneBody block;
  block.name = "block";
  block.mass_kg = push.mass_kg;
  block.inertia = Mat3::Identity();
  block.colliders = {MakeCollider(world::HalfSpace{.normal = -Vec3::UnitX()}, push.friction)};
  world::SceneBody floor;
  floor.name = "floor";
  floor.fixed = true;
  world::Scene scene;
  scene.name = "fig6";
  scene.bodies = {block, floor};
  return scene;
}

world::Scene CubeScene(const BlockPush& push) {
  world::SceneBody block;
  block.name = "block";
  block.mass_kg = push.mass_kg;
  block.inertia = Mat3::Identity() * (push.mass_kg * 4 * kCubeHalf * kCubeHalf / 6);
  block.pose_WB.position = Vec3(kCubeHalf, 0, 0);
  block.colliders = {MakeCollider(world::Box{Vec3::Constant(kCubeHalf)}, push.friction)};
  world::SceneBody floor;
  floor.name = "floor";
  floor.fixed = true;
  floor.pose_WB.position = Vec3(0, 0, -kCubeHalf);
  floor.colliders = {MakeCollider(world::HalfSpace{.normal = Vec3::UnitZ()}, push.friction)};
  world::Scene scene;
  scene.name = "fig6";
  scene.bodies = {block, floor};
  return scene;
}

}  // namespace

haptic::Hand HandOf(PushScenario scenario) {
  const bool poke = scenario == PushScenario::kPoke;
  const Vec3 home((poke ? -0.040 : -0.050), 0, 0);
  const Vec3 far((poke ? 0.020 : 0.100), 0, 0);
  const double reach_s = poke ? 0.120 : 0.300;
  haptic::MotorProgram::Script script{.home = home, .strokes = {{far, reach_s}}};
  if (!poke) script.strokes.push_back({far, 0.100});
  script.strokes.push_back({home, reach_s});
  // numerics section 4: hands light and firm, the device's 0.03 kg and 0.2 Ns/m included.
  const haptic::Impedance impedance =
      poke ? haptic::Impedance{0.13, 2.2, 50} : haptic::Impedance{0.93, 15.2, 500};
  return {haptic::MotorProgram(script), impedance};
}

PreparedRun PrepareBlockPush(const BlockPush& push, haptic::Hand hand) {
  const haptic::Settings haptic_settings = HapticSettings(push);
  const world::Settings world_settings = WorldSettings(push);
  if (world_settings.period_ns() % haptic_settings.period_ns() != 0) {
    throw std::invalid_argument("the world period is not a whole number of haptic periods");
  }
  const bool engine = push.world == PushedWorld::kBullet;
  const world::Scene scene = engine ? CubeScene(push) : SlidingScene(push);
  std::unique_ptr<world::DynamicsWorld> dynamics;
  if (engine) {
    dynamics =
        std::make_unique<world::BulletWorld>(scene, world_settings.physics.substep_ms * 1e-3);
  } else {
    // A world that replays ticks steps by the rule of the copy.
    const bool replays =
        push.coupling == protocol::Coupling::kLocal && push.local != LocalVariant::kLump;
    const bool exact = replays ? push.position_rule == PositionRule::kSecondOrder
                               : push.world == PushedWorld::kExactSlide;
    dynamics = std::make_unique<world::SlidingBlock>(
        scene, push.friction, exact ? world::SlideRule::kExact : world::SlideRule::kSemiImplicit,
        replays ? push.haptic_period_s : std::numeric_limits<double>::infinity());
  }
  PreparedRun prepared{.device = std::make_unique<IdealDevice>(
                           std::move(hand), CoupledRun::StartNs(haptic_settings)),
                       .loops = nullptr,
                       .duration_s = kDuration};
  prepared.loops = std::make_unique<CoupledRun>(haptic_settings, *prepared.device, world_settings,
                                                scene, std::move(dynamics), push.phase_ticks);
  if (push.local == LocalVariant::kBlock) prepared.loops->LapTheWorld();
  return prepared;
}

BlockPushResult SimulateBlockPush(const BlockPush& push) {
  const PreparedRun prepared = PrepareBlockPush(push, HandOf(push.scenario));
  CoupledRun& run = *prepared.loops;

  BlockPushResult result;
  const auto block = [&]() -> const protocol::Body& { return run.world().Bodies()[0]; };
  const double start = block().position[0];
  const auto ticks = std::llround(kDuration / push.haptic_period_s);
  for (long long k = 0; k < ticks; ++k) {
    if (!run.Tick()) continue;
    result.peak_speed_m_per_s = std::max(result.peak_speed_m_per_s, std::abs(block().velocity[0]));
  }
  result.final_position_m = block().position[0] - start;
  result.total_impulse_ns =
      static_cast<double>(run.haptic_health().books.displayed[0]) * protocol::kImpulseUnit;
  return result;
}

}  // namespace rikiseki::lab
