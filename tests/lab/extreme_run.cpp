// SPDX-License-Identifier: MIT
#include "tests/lab/extreme_run.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <utility>

#include "common/clock.h"
#include "tests/lab/coupled_run.h"
#include "tests/lab/ideal_device.h"
#include "tests/lab/outbound_check.h"
#include "tests/lab/prescribed_device.h"
#include "tests/lab/push_script.h"
#include "world_server/physics/bullet_world.h"

namespace rikiseki::lab {
namespace {

// m, of the boxes on either side of the slot: next to nothing flies out. Bullet takes what is longer
// than 1e6 m out of its world.
constexpr double kSlotHalf = 1.4e5;
constexpr double kFirstForce = 0.5;   // N, at most, that the finger in the slot starts with
constexpr double kFirstDepth = 1e-3;  // m, likewise
constexpr double kSqueeze = 5e-4;     // m, of the prescribed finger
constexpr double kWallGap = 1e-3;     // m, behind the cube
constexpr double kFriction = 0.3;
constexpr double kFarAway = 1e8;    // m
constexpr double kFastSpeed = 1e6;  // m/s
constexpr double kSilenceFrom = 2;  // s
constexpr double kSilence = 5;      // s

// What the device is told, watched; and what it tells, spoilt.
class WatchedDevice final : public haptic::Device {
 public:
  WatchedDevice(std::unique_ptr<haptic::Device> device, bool spoils)
      : device_(std::move(device)), spoils_(spoils) {}

  haptic::DeviceStatus Read(std::int64_t now_ns, haptic::DeviceSample& sample) noexcept override {
    const haptic::DeviceStatus status = device_->Read(now_ns, sample);
    if (spoils_) Spoil(sample);
    ++reads_;
    return status;
  }
  Vec3 Write(const Vec3& force) noexcept override {
    finite_ = finite_ && force.allFinite();
    largest_force_n_ = std::max(largest_force_n_, force.norm());
    largest_step_n_ = std::max(largest_step_n_, (force - force_).norm());
    force_ = force;
    return device_->Write(force);
  }
  void Release() noexcept override { device_->Release(); }
  std::string Name() const override { return device_->Name(); }

  bool finite() const { return finite_; }
  double largest_force_n() const { return largest_force_n_; }
  double largest_step_n() const { return largest_step_n_; }

 private:
  void Spoil(haptic::DeviceSample& sample) const {
    constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    switch (reads_ % 97) {
      case 20:
        sample.position.x() = kNan;
        break;
      case 21:
        sample.position.setConstant(-kInfinity);
        break;
      case 40:
        sample.velocity.y() = kNan;
        break;
      case 41:
        sample.velocity.z() = kInfinity;
        break;
      case 60:
        sample.position.z() = 1e300;
        break;
      case 80:
        sample.target.x() = kNan;
        break;
      default:
        break;
    }
  }

  std::unique_ptr<haptic::Device> device_;
  bool spoils_;
  long reads_ = 0;
  bool finite_ = true;
  Vec3 force_ = Vec3::Zero();
  double largest_force_n_ = 0;
  double largest_step_n_ = 0;
};

haptic::Settings HapticSettings(const ExtremeRun& extreme) {
  haptic::Settings settings;
  settings.loop.rate_hz = extreme.haptic_hz;
  settings.loop.longest_world_period_ms =
      std::max(settings.loop.longest_world_period_ms, 1e3 / extreme.world_hz);
  settings.render.stiffness_n_per_m = extreme.stiffness_n_per_m;
  settings.render.damping_ns_per_m = extreme.damping_ns_per_m;
  settings.render.finger_radius_mm = kFingerRadius * 1e3;
  settings.safety.soft_start_ms = 0;
  return settings;
}

world::Settings WorldSettings(const ExtremeRun& extreme) {
  world::Settings settings;
  settings.loop.rate_hz = extreme.world_hz;
  settings.coupling.coupling = extreme.coupling;
  return settings;
}

// Two boxes in one body, as far apart as the finger is thick: it is held from both sides, without
// play.
world::Scene SlotScene(const ExtremeRun& extreme) {
  world::SceneBody block;
  block.name = "slot";
  block.mass_kg = extreme.mass_kg;
  block.inertia = Mat3::Identity() * (extreme.mass_kg * 2 * kSlotHalf * kSlotHalf / 3);
  block.pose_WB.position.x() = std::min(kFirstDepth, kFirstForce / extreme.stiffness_n_per_m);
  for (const double side : {-1, 1}) {
    world::Collider box{.shape = world::Box{Vec3::Constant(kSlotHalf)}, .friction = kFriction};
    box.pose_BS.position.x() = side * (kSlotHalf + kFingerRadius);
    block.colliders.push_back(box);
  }
  world::Scene scene;
  scene.name = "slot";
  scene.gravity.setZero();
  scene.bodies = {block};
  return scene;
}

CubePush SqueezedCube(const ExtremeRun& extreme) {
  return {.script = PushScript::kWall,
          .mass_kg = extreme.mass_kg,
          .friction = kFriction,
          .stiffness_n_per_m = extreme.stiffness_n_per_m,
          .damping_ns_per_m = extreme.damping_ns_per_m,
          .gap_m = kWallGap};
}

// Where the finger touches the face of the cube that lies against the wall.
Vec3 TouchedCube() {
  return {kWallGap - kCubeHalf - kFingerRadius, 0, kCubeHalf};
}

PrescribedDevice::Path EventPath(ExtremeEvent event) {
  const Vec3 touch = TouchedCube();
  const Vec3 squeeze = touch + kSqueeze * Vec3::UnitX();
  return [=](double t_s) -> Vec3 {
    const double s = std::fmod(t_s, 1.0);  // the event comes every second
    switch (event) {
      case ExtremeEvent::kFast: {
        const double away = std::clamp(std::min(s - 0.6, 0.8 - s), 0.0, 0.1);
        return squeeze - kFastSpeed * away * Vec3::UnitX();
      }
      case ExtremeEvent::kFar:
        return s < 0.6 || s > 0.8 ? squeeze : Vec3(squeeze - Vec3::Constant(kFarAway));
      case ExtremeEvent::kDenormal:
        return s < 0.5 ? squeeze
                       : Vec3(touch + std::numeric_limits<double>::denorm_min() * Vec3::UnitX());
      default:
        return squeeze;
    }
  };
}

std::unique_ptr<haptic::Device> MakeFinger(const ExtremeRun& extreme, std::int64_t start_ns) {
  if (extreme.event != ExtremeEvent::kSlot) {
    return std::make_unique<PrescribedDevice>(EventPath(extreme.event), start_ns);
  }
  const auto rest = [](double) -> Vec3 { return Vec3::Zero(); };
  if (!extreme.hand) return std::make_unique<PrescribedDevice>(rest, start_ns);
  return std::make_unique<IdealDevice>(haptic::Hand(rest, *extreme.hand), start_ns);
}

}  // namespace

ExtremeResult SimulateExtreme(const ExtremeRun& extreme) {
  const haptic::Settings haptic_settings = HapticSettings(extreme);
  const world::Settings world_settings = WorldSettings(extreme);
  const world::Scene scene =
      extreme.event == ExtremeEvent::kSlot ? SlotScene(extreme) : PushScene(SqueezedCube(extreme));
  WatchedDevice device(MakeFinger(extreme, CoupledRun::StartNs(haptic_settings)),
                       extreme.event == ExtremeEvent::kNotFinite);
  CoupledRun run(
      haptic_settings, device, world_settings, scene,
      std::make_unique<world::BulletWorld>(scene, world_settings.physics.substep_ms * 1e-3),
      /*phase_ticks=*/0, extreme.latency_ticks);
  OutboundCheck outbound;
  const double period_s = Seconds(haptic_settings.period_ns());
  const long long ticks = std::llround(extreme.duration_s / period_s);
  for (long long k = 0; k < ticks; ++k) {
    if (extreme.event == ExtremeEvent::kSilence) {
      const double t_s = static_cast<double>(k) * period_s;
      run.SilenceWorld(t_s >= kSilenceFrom && t_s < kSilenceFrom + kSilence);
    }
    const bool world_ticked = run.Tick();
    outbound.Look(run.haptic_tick(), run.haptic_health());
    if (world_ticked) {
      outbound.Look(run.world_frame(), run.world().health(), run.world().Bodies());
    }
  }
  return {.sound = outbound.sound(),
          .complaint = outbound.complaint(),
          .force_finite = device.finite(),
          .largest_force_n = device.largest_force_n(),
          .largest_step_n = device.largest_step_n(),
          .force_cap_n = haptic_settings.safety.force_cap_n,
          .step_limit_n = haptic_settings.safety.slew_limit_n_per_s * period_s,
          .flagged = run.haptic_health().energy.flagged > 0};
}

}  // namespace rikiseki::lab
