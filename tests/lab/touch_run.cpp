// SPDX-License-Identifier: MIT
#include "tests/lab/touch_run.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <memory>
#include <numbers>
#include <optional>
#include <stdexcept>

#include "haptic_server/device/mapping.h"
#include "protocol/codec.h"
#include "tests/lab/coupled_run.h"
#include "tests/lab/ideal_device.h"
#include "world_server/physics/bullet_world.h"
#include "world_server/physics/deformable_world.h"
#include "world_server/step.h"

namespace rikiseki::lab {
namespace {

constexpr double kFarAway = 1;        // m, from where the scene is looked at
constexpr double kApproach = 0.01;    // m, between the resting finger and the surface
constexpr double kDepth = 0.015;      // m, of where the hand wants to be
constexpr double kStroke = 0.005;     // m, to and fro along the surface
constexpr double kPressAfter = 0.15;  // s
constexpr double kLeaveAfter = 0.6;   // s
constexpr double kDuration = 0.9;     // s
constexpr double kLead = 0.3;         // s, at rest before that: longer than the soft start
constexpr haptic::Impedance kHand{0.58, 6.7, 135};  // medium, of numerics section 4

// Puts a device that measures in world axes into the axes that the settings' mapping undoes.
class TurnedDevice final : public haptic::Device {
 public:
  TurnedDevice(haptic::Device& device, const haptic::MappingSettings& settings)
      : device_(device),
        mapping_(settings),
        origin_(settings.origin_mm * 1e-3),
        scale_(settings.motion_scale),
        force_scale_(settings.force_scale),
        is_plain_(settings.rotation_deg.isZero(0) && origin_.isZero(0) && scale_ == 1 &&
                  force_scale_ == 1) {}

  haptic::DeviceStatus Read(std::int64_t now_ns, haptic::DeviceSample& sample) noexcept override {
    const haptic::DeviceStatus status = device_.Read(now_ns, sample);
    if (is_plain_) return status;
    sample.position = Turned(sample.position - origin_);
    sample.velocity = Turned(sample.velocity);
    sample.target = Turned(sample.target - origin_);
    return status;
  }
  Vec3 Write(const Vec3& force) noexcept override {
    device_.Write(is_plain_ ? force : mapping_.ForceInWorld(force));
    return force;
  }
  void Release() noexcept override { device_.Release(); }
  std::string Name() const override { return device_.Name(); }

 private:
  Vec3 Turned(const Vec3& way) const {
    return mapping_.ForceOnDevice(way) / (force_scale_ * scale_);
  }

  haptic::Device& device_;
  haptic::Mapping mapping_;
  Vec3 origin_;
  double scale_;
  double force_scale_;
  bool is_plain_;
};

std::unique_ptr<world::DynamicsWorld> DynamicsOf(const Touch& touch) {
  const double substep_s = touch.world.physics.substep_ms * 1e-3;
  if (!touch.parts || Deforms(touch.scene)) return world::MakeDynamics(touch.scene, substep_s);
  return std::make_unique<world::BulletWorld>(touch.scene, substep_s, *touch.parts);
}

Vec3 Across(const Vec3& normal) {
  const Vec3 axis = std::abs(normal.z()) < 0.7 ? Vec3::UnitZ() : Vec3::UnitY();
  return normal.cross(axis).normalized();
}

Vec3 HandTarget(const Touch& touch, double t_s) {
  const double radius = touch.haptic.render.finger_radius_mm * 1e-3;
  const double pressed = haptic::MinimumJerk(t_s / kPressAfter) -
                         haptic::MinimumJerk((t_s - kLeaveAfter) / kPressAfter);
  const double out = radius + kApproach - (kApproach + kDepth) * pressed;
  const double stroking = std::clamp(t_s - kPressAfter, 0.0, kLeaveAfter - kPressAfter);
  const double along = kStroke * std::sin(4 * std::numbers::pi * stroking);
  return touch.place + out * touch.normal + along * Across(touch.normal);
}

// What the world itself says of a finger there, before anything moves.
std::vector<protocol::Plane> PlanesAbout(const Touch& touch, const Vec3& finger, double radius_mm) {
  world::Settings settings = touch.world;
  settings.features.radius_mm = radius_mm;
  world::WorldStep world(settings, touch.scene,
                         world::MakeDynamics(touch.scene, settings.physics.substep_ms * 1e-3), 0);
  world.BeginHapticEpoch(1);
  protocol::HapticTick tick;
  tick.pointer_count = 1;
  tick.pointers[0].position = ToArray(finger);
  world.Consume(tick);
  protocol::WorldFrame frame;
  world.Tick(0, frame);
  return {frame.planes.begin(), frame.planes.begin() + frame.plane_count};
}

// The hand waits where nothing is touched.
bool IsFreeAtRest(const Touch& touch) {
  const Vec3 finger = HandTarget(touch, 0);
  const double radius = touch.haptic.render.finger_radius_mm * 1e-3;
  const std::vector<protocol::Plane> planes =
      PlanesAbout(touch, finger, touch.world.features.radius_mm);
  return std::all_of(planes.begin(), planes.end(), [&](const protocol::Plane& plane) {
    return (finger - ToVec3(plane.point)).dot(ToVec3(plane.normal)) > radius;
  });
}

void Append(const protocol::HapticTick& tick, std::vector<std::uint64_t>& trace) {
  protocol::HapticTick told = tick;
  told.stiffness = told.damping = told.force_cap = 0;
  std::array<std::uint64_t, protocol::kHapticTickBytes / 8> words{};
  const protocol::Encoded encoded = protocol::Encode(told, words);
  trace.insert(trace.end(), words.begin(), words.begin() + encoded.used_bytes / 8);
}

void Append(const protocol::Body& body, std::vector<std::uint64_t>& trace) {
  const auto append = [&](const auto& values) {
    for (const double x : values) trace.push_back(std::bit_cast<std::uint64_t>(x));
  };
  append(body.position);
  append(body.orientation);
  append(body.velocity);
  append(body.angular_velocity);
}

}  // namespace

Touch TouchOf(const world::Scene& scene) {
  Touch touch{.scene = scene, .haptic = {}, .world = {}};
  touch.haptic.safety.force_cap_n = 1e6;  // a hand that presses shall not meet the limits
  touch.haptic.safety.slew_limit_n_per_s = 1e9;
  std::size_t body = 0;
  while (body < scene.bodies.size() && scene.bodies[body].fixed) ++body;
  if (body == scene.bodies.size()) body = 0;
  if (body == scene.bodies.size()) throw std::invalid_argument(scene.name + ": nothing to touch");

  std::optional<Touch> first;
  for (const Vec3& side : {Vec3(-Vec3::UnitX()), Vec3(Vec3::UnitX()), Vec3(-Vec3::UnitY()),
                           Vec3(Vec3::UnitY()), Vec3(Vec3::UnitZ())}) {
    const Vec3 afar = scene.bodies[body].pose_WB.position + kFarAway * side;
    for (const protocol::Plane& plane : PlanesAbout(touch, afar, 1e6)) {  // nearest first
      if (plane.body != body) continue;
      touch.place = ToVec3(plane.point);
      touch.normal = ToVec3(plane.normal);
      if (IsFreeAtRest(touch)) return touch;
      if (!first) first = touch;
      break;
    }
  }
  if (!first) throw std::invalid_argument(scene.name + ": the body to touch has no shape");
  return *first;
}

bool SameMotion(const TouchResult& a, const TouchResult& b) {
  const auto count = static_cast<std::ptrdiff_t>(std::min(a.bodies.size(), b.bodies.size()));
  return a.ticks == b.ticks &&
         std::equal(a.bodies.begin(), a.bodies.begin() + count, b.bodies.begin());
}

TouchResult RunTouch(const Touch& touch) {
  const std::int64_t period_ns = touch.haptic.period_ns();
  const auto ticks = [&](double time_s) {
    return std::llround(time_s * 1e9 / static_cast<double>(period_ns));
  };
  IdealDevice hand(haptic::Hand([&touch](double t_s) { return HandTarget(touch, t_s); }, kHand),
                   CoupledRun::StartNs(touch.haptic) + ticks(kLead) * period_ns);
  TurnedDevice device(hand, touch.haptic.mapping);
  CoupledRun run(touch.haptic, device, touch.world, touch.scene, DynamicsOf(touch),
                 /*phase_ticks=*/0);
  if (touch.alter_frame) run.AlterFrames(touch.alter_frame);
  for (long long k = 0; k < ticks(kLead); ++k) {
    run.Tick({.clutch = touch.clutches_first && k > 0 && k < 10});
  }

  TouchResult result;
  for (long long k = 0; k < ticks(kDuration); ++k) {
    const bool world_ticked = run.Tick();
    Append(run.haptic_tick(), result.ticks);
    const double force_n = ToVec3(run.haptic_tick().pointers[0].force).norm();
    result.largest_force_n = std::max(result.largest_force_n, force_n);
    if (force_n > 0) result.haptic_us.push_back(1e6 * run.effort().haptic_s);
    if (!world_ticked) continue;
    const std::vector<protocol::Body>& bodies = run.world().Bodies();
    result.bodies.resize(bodies.size());
    for (std::size_t i = 0; i < bodies.size(); ++i) Append(bodies[i], result.bodies[i]);
    result.world_us.push_back(1e6 * run.effort().world_s);
  }
  return result;
}

}  // namespace rikiseki::lab
