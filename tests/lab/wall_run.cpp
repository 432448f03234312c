// SPDX-License-Identifier: MIT
#include "tests/lab/wall_run.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>

#include "common/clock.h"
#include "world_server/physics/bullet_world.h"

namespace rikiseki::lab {
namespace {

constexpr double kUnlimited = 1e9;     // for limits that must not act: N, N/s, m/s, mm
constexpr double kWorldPeriod = 0.02;  // s: a wall that stands still needs no more

std::int64_t PeriodNs(const WallSurface& wall) {
  return std::llround(wall.period_s * 1e9);
}

world::Settings WorldSettings(const WallSurface& wall) {
  const double period_s = Seconds(PeriodNs(wall));
  world::Settings settings;
  settings.loop.rate_hz = 1 / (std::max(1.0, std::round(kWorldPeriod / period_s)) * period_s);
  settings.features.radius_mm = kUnlimited;
  return settings;
}

world::Scene WallScene() {
  world::Collider collider;
  collider.shape = world::HalfSpace{.normal = -Vec3::UnitX()};
  world::SceneBody wall;
  wall.name = "wall";
  wall.fixed = true;
  wall.colliders = {collider};
  world::Scene scene;
  scene.name = "wall";
  scene.bodies = {wall};
  return scene;
}

std::unique_ptr<world::DynamicsWorld> Dynamics(const WallSurface& wall) {
  return std::make_unique<world::BulletWorld>(WallScene(),
                                              Seconds(WorldSettings(wall).period_ns()));
}

}  // namespace

haptic::Settings WallRun::HapticSettings(const WallSurface& wall) {
  haptic::Settings settings;
  settings.loop.rate_hz = 1e9 / static_cast<double>(PeriodNs(wall));
  settings.render.stiffness_n_per_m = wall.stiffness_n_per_m;
  settings.render.damping_ns_per_m = wall.damping_ns_per_m;
  settings.render.adhesion = wall.adhesion;
  settings.render.finger_radius_mm = 0;
  settings.safety.force_cap_n = kUnlimited;
  settings.safety.slew_limit_n_per_s = kUnlimited * 1e6;
  settings.safety.speed_limit_m_per_s = kUnlimited;
  settings.safety.soft_start_ms = 0;
  return settings;
}

WallRun::WallRun(const WallSurface& wall, haptic::Device& device)
    : run_(HapticSettings(wall), device, WorldSettings(wall), WallScene(), Dynamics(wall),
           /*phase_ticks=*/0) {}

double WallRun::impulse() const {
  const protocol::Books& books = run_.haptic_health().books;
  return static_cast<double>(books.displayed[0] + books.ground[0]) * protocol::kImpulseUnit;
}

PressedDevice::PressedDevice(const Setup& setup) : setup_(setup), position_(setup.start_m) {
  if (setup.delay_samples < 0 || setup.delay_samples > kLongestDelay) {
    throw std::invalid_argument("a pressed device is 0 to 63 samples late");
  }
  positions_.fill(position_);
}

haptic::DeviceStatus PressedDevice::Read(std::int64_t now_ns,
                                         haptic::DeviceSample& sample) noexcept {
  const std::int64_t dt_ns = now_ns - std::max(now_ns_, setup_.release_ns);
  if (dt_ns > 0) {
    if (dt_ns != step_ns_) {
      step_ns_ = dt_ns;
      step_ = haptic::ExactStep(setup_.impedance, Seconds(dt_ns));
    }
    const double force = force_ + setup_.press_n;
    const double position = step_.yy * position_ + step_.yv * velocity_ + step_.yf * force;
    velocity_ = step_.vy * position_ + step_.vv * velocity_ + step_.vf * force;
    position_ = position;
  }
  now_ns_ = now_ns;
  positions_[reads_ % positions_.size()] = position_;
  const std::size_t late =
      reads_ + positions_.size() - static_cast<std::size_t>(setup_.delay_samples);
  sample = {};
  sample.position.x() = sample.target.x() = positions_[late % positions_.size()];
  ++reads_;
  return haptic::DeviceStatus::kOk;
}

Vec3 PressedDevice::Write(const Vec3& force) noexcept {
  force_ = force.x();
  return force;
}

}  // namespace rikiseki::lab
